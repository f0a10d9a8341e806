// SPDX-License-Identifier: Apache-2.0
#include <render/shadow_cache.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

// What lies so far beyond a page's edge may still cover some of it: texels.
constexpr double kReach = 8.0;

// Whether something within a box of the world may be seen by a page, of which the light-space box
// is given; behind it or before does not matter.
bool mayShow(const PageKey& key, const LightSpace& light, const DBox3& box) {
    const double page = std::ldexp(1.0, key.exponent) * kPageTexels,
                 reach = std::ldexp(1.0, key.exponent) * kReach;
    double z_near = 1.0, z_far = 1.0;
    if (light.is_lamp) {
        if (!(box.max.z > 0.0)) return false;
        z_near = std::max(box.min.z, 0.0), z_far = box.max.z;
    }
    // A lamp's pages are pyramids: at some depth within the box they meet it, or pass it by.
    const auto meets = [&](double low, double high, double first, double last) {
        return std::max(last * z_near, last * z_far) >= low &&
               std::min(first * z_near, first * z_far) <= high;
    };
    return meets(box.min.x, box.max.x, double(key.x) * page - reach,
                 double(key.x + 1) * page + reach) &&
           meets(box.min.y, box.max.y, double(key.y) * page - reach,
                 double(key.y + 1) * page + reach);
}

}  // namespace

RenderSettings shadowSettings(const RenderSettings& settings) {
    RenderSettings drawn = settings;
    drawn.subpixels = 1;
    drawn.samples = 2.0;  // a hole in a page is light within a shadow, for as long as it is kept
    drawn.tile_size = kPageTexels;
    drawn.splat_world = 0.0;
    drawn.visible_size = 0.0;  // the same lists as the camera's, and no loss of depth
    drawn.large_triangle = double(kInfinity);  // the tiles' rasterizer draws no page in vain
    return drawn;
}

void ShadowCache::begin(const RenderSettings& settings) {
    ++frame_;
    // What no page depends on: how the picture itself is drawn and shown.
    const RenderSettings none;
    RenderSettings drawn = shadowSettings(settings);
    drawn.width = none.width, drawn.height = none.height;
    drawn.splat_size = none.splat_size;
    drawn.ewa_prefilter = none.ewa_prefilter;
    drawn.pull_push_threshold = none.pull_push_threshold;
    drawn.fill = none.fill;
    drawn.shadow_texel = none.shadow_texel;
    drawn.ao = none.ao, drawn.ao_radius = none.ao_radius, drawn.ao_rays = none.ao_rays;
    drawn.exposure = none.exposure, drawn.tone = none.tone;
    drawn.threads = none.threads, drawn.cache_mb = none.cache_mb;
    if (!(drawn == settings_)) {
        lights_.clear();
        count_ = 0;
    }
    settings_ = drawn;
}

ShadowCache::Light& ShadowCache::lightOf(const LightSpace& space) {
    for (Light& light : lights_) {
        if (light.space == space) return light;
    }
    lights_.push_back({space, {}});
    return lights_.back();
}

std::shared_ptr<const ShadowPage> ShadowCache::find(const LightSpace& light, const PageKey& key) {
    std::map<PageKey, Entry>& pages = lightOf(light).pages;
    const auto found = pages.find(key);
    if (found == pages.end()) return nullptr;
    found->second.last_frame = frame_;
    return found->second.page;
}

void ShadowCache::keep(const LightSpace& light, const PageKey& key,
                       std::shared_ptr<const ShadowPage> page) {
    lightOf(light).pages[key] = {std::move(page), frame_};
    ++count_;
}

void ShadowCache::end(size_t most_bytes) {
    const size_t most = most_bytes / sizeof(ShadowPage);
    if (count_ > most) {
        std::vector<uint64_t> ages;  // frames since a page was asked for
        for (const Light& light : lights_) {
            for (const auto& [key, entry] : light.pages) ages.push_back(frame_ - entry.last_frame);
        }
        // Younger ones stay, and of that age as many as there is room for.
        std::nth_element(ages.begin(), ages.begin() + ptrdiff_t(most), ages.end());
        const uint64_t limit = ages[most];
        size_t room = most - size_t(std::count_if(ages.begin(), ages.end(),
                                                  [&](uint64_t age) { return age < limit; }));
        for (Light& light : lights_) {
            std::erase_if(light.pages, [&](const auto& page) {
                const uint64_t age = frame_ - page.second.last_frame;
                return age > limit || (age == limit && !(room > 0 && room--));
            });
        }
        count_ = most;
    }
    std::erase_if(lights_, [](const Light& light) { return light.pages.empty(); });
}

void ShadowCache::sceneChanged(const SceneChanges& changes) {
    if (changes.anywhere) {
        lights_.clear();
        count_ = 0;
        return;
    }
    for (Light& light : lights_) {
        Affine light_from_world;
        light_from_world.linear = glm::transpose(light.space.world_from_light);
        if (light.space.is_lamp)
            light_from_world.translation = -(light_from_world.linear * light.space.lamp);
        std::vector<DBox3> boxes;
        for (const DBox3& box : changes.boxes) boxes.push_back(transformBox(light_from_world, box));
        count_ -= std::erase_if(light.pages, [&](const auto& page) {
            return std::any_of(boxes.begin(), boxes.end(), [&](const DBox3& box) {
                return mayShow(page.first, light.space, box);
            });
        });
    }
}

}  // namespace stipple
