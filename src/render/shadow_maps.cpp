// SPDX-License-Identifier: Apache-2.0
#include <render/shadow_maps.h>

#include <core/stopwatch.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

// What the first look has seen may reach this far beyond: texels.
constexpr double kPageMargin = 8.0;
// A level's pages lie within a rectangle of at most so many along a side; farther apart, they are
// taken from the next coarser level.
constexpr int64_t kMostPagesAlong = 1024;
// A coarser page stands by for what the first look has missed, so many levels up.
constexpr int kSpareLevels = 2;
// Below this share of its colour nothing is seen through haze.
constexpr float kHazeLeft = 1.0f / 256.0f;

// A page in the world: of a level, at whole multiples of its size from the origin.
struct PageKey {
    int exponent = 0;
    int64_t x = 0, y = 0;

    bool operator<(const PageKey& o) const {
        return exponent != o.exponent ? exponent < o.exponent : y != o.y ? y < o.y : x < o.x;
    }
    bool operator==(const PageKey& o) const {
        return exponent == o.exponent && y == o.y && x == o.x;
    }
};

void sortUnique(std::vector<PageKey>& pages) {
    std::sort(pages.begin(), pages.end());
    pages.erase(std::unique(pages.begin(), pages.end()), pages.end());
}

class ShadowBuilder {
public:
    ShadowBuilder(const Scene& scene, const View& view, const DepthDrawer& drawer)
        : scene_(scene), view_(view), drawer_(drawer), settings_(drawer.request.settings) {
        const DBox3 bounds = sceneBounds(scene);
        bounds_min_ = bounds.min;
        bounds_max_ = bounds.max;
    }

    std::unique_ptr<ShadowPages> build(const FirstLook& look, FrameStats& stats) {
        std::vector<SunShadow> suns;
        for (const Sun& sun : scene_.lighting.suns) suns.push_back(drawSun(sun, look));
        stats.shadow_points += drawn_.points_drawn;
        return std::make_unique<ShadowPages>(view_, settings_.shadow_texel, std::move(suns));
    }

private:
    // Pages that hold what the look has seen, at the size of a pixel there, and spare ones.
    std::vector<PageKey> neededPages(const DMat3& sun_from_world, const FirstLook& look,
                                     const ShadowPages& sizes) const {
        const float haze = scene_.lighting.sky.haze_distance;
        const float farthest = haze > 0.0f ? -haze * std::log(kHazeLeft) : kInfinity;
        const DMat3 sun_from_camera = sun_from_world * glm::transpose(view_.camera_from_world);
        const DVec3 eye = sun_from_world * view_.eye_world;
        std::vector<PageKey> pages;
        for (int y = 0; y < look.view.height; ++y) {
            for (int x = 0; x < look.view.width; ++x) {
                const float depth = look.depth[size_t(y) * size_t(look.view.width) + size_t(x)];
                if (!(depth < kInfinity)) continue;
                Vec3 origin, direction;
                look.view.ray(float(x) + 0.5f, float(y) + 0.5f, origin, direction);
                const Vec3 p_camera = origin + direction * depth;
                if (glm::length(p_camera) > farthest) continue;
                const DVec3 p = eye + sun_from_camera * DVec3(p_camera);
                // What lies a little nearer or farther may fall into the level beside.
                const float texel = sizes.wantedTexel(depth);
                const int low = levelExponent(texel * 0.93f), high = levelExponent(texel * 1.07f);
                for (int e = low; e <= high; ++e) addPages(pages, p, e);
                addPages(pages, p, high + kSpareLevels);
            }
            sortUnique(pages);
        }
        return pages;
    }

    static void addPages(std::vector<PageKey>& pages, const DVec3& p, int exponent) {
        const double texel = std::ldexp(1.0, exponent);
        const double per_page = 1.0 / (texel * kPageTexels), margin = kPageMargin * texel;
        for (int k = 0; k < 4; ++k) {
            const PageKey key{exponent,
                              int64_t(std::floor((p.x + (k & 1 ? margin : -margin)) * per_page)),
                              int64_t(std::floor((p.y + (k & 2 ? margin : -margin)) * per_page))};
            if (pages.empty() || !(pages.back() == key)) pages.push_back(key);
        }
    }

    SunShadow drawSun(const Sun& sun, const FirstLook& look) {
        SunShadow shadow;
        const DMat3 world_from_sun =
            lookAt(DVec3(0.0), -DVec3(sun.direction_to_light)).world_from_camera;
        shadow.sun_from_world = glm::transpose(world_from_sun);
        const ShadowPages sizes(view_, settings_.shadow_texel, {});
        std::vector<PageKey> pages = neededPages(shadow.sun_from_world, look, sizes);
        if (pages.empty()) return shadow;
        shadow.first_exponent = pages.front().exponent;
        for (int exponent = shadow.first_exponent; !pages.empty(); ++exponent) {
            const auto end = std::find_if(pages.begin(), pages.end(), [&](const PageKey& key) {
                return key.exponent != exponent;
            });
            std::vector<PageKey> own(pages.begin(), end);
            pages.erase(pages.begin(), end);
            ShadowLevel level;
            level.texel = float(std::ldexp(1.0, exponent));
            if (!own.empty() && !drawLevel(own, world_from_sun, level)) {
                for (const PageKey& key : own)
                    pages.push_back({exponent + 1, key.x >> 1, key.y >> 1});
                sortUnique(pages);
            }
            shadow.levels.push_back(std::move(level));
        }
        return shadow;
    }

    // False if the pages lie too far apart.
    bool drawLevel(const std::vector<PageKey>& pages, const DMat3& world_from_sun,
                   ShadowLevel& level) {
        int64_t x0 = pages[0].x, x1 = x0, y0 = pages[0].y, y1 = y0;
        for (const PageKey& key : pages) {
            x0 = std::min(x0, key.x), x1 = std::max(x1, key.x);
            y0 = std::min(y0, key.y), y1 = std::max(y1, key.y);
        }
        if (x1 - x0 >= kMostPagesAlong || y1 - y0 >= kMostPagesAlong) return false;
        level.columns = int(x1 - x0) + 1;
        level.rows = int(y1 - y0) + 1;
        level.page_slot.assign(size_t(level.columns) * size_t(level.rows), -1);
        for (size_t i = 0; i < pages.size(); ++i) {
            level.page_slot[size_t(pages[i].y - y0) * size_t(level.columns) +
                            size_t(pages[i].x - x0)] = int32_t(i);
        }
        level.depth.assign(pages.size() * kPageTexels * kPageTexels, kInfinity);

        const double page = double(level.texel) * kPageTexels;
        double z_min, z_max;
        const DVec3 corner(double(x0) * page, double(y0) * page, 0.0);
        depthRange(world_from_sun, corner, level.columns * page, level.rows * page, z_min, z_max);
        if (!(z_min <= z_max)) return true;  // nothing there
        level.origin = DVec3(corner.x, corner.y, z_min - 1.0);
        View view;
        view.width = level.columns * kPageTexels;
        view.height = level.rows * kPageTexels;
        view.orthographic = true;
        view.eye_world = world_from_sun * level.origin;
        view.camera_from_world = glm::transpose(world_from_sun);
        view.focal = 1.0 / double(level.texel);
        view.near_z = 0.5f;
        view.far_z = float(z_max - z_min + 2.0);
        RenderSettings settings = settings_;
        settings.subpixels = 1;
        settings.samples = 1.0;
        settings.tile_size = kPageTexels;
        settings.splat_world = 0.0;
        settings.visible_size = 0.0;  // the same lists as the camera's, and no loss of depth
        settings.large_triangle = double(kInfinity);  // the tiles' rasterizer draws no page in vain
        const auto slotOf = [&](const SubpixelRect& inner) {
            return level.page_slot[size_t(inner.y0 / kPageTexels) * size_t(level.columns) +
                                   size_t(inner.x0 / kPageTexels)];
        };
        const TakeDepths take = [&](const SubpixelRect& inner, const DepthTile& tile) {
            float* out = level.depth.data() + size_t(slotOf(inner)) * kPageTexels * kPageTexels;
            for (int y = inner.y0; y < inner.y1; ++y) {
                for (int x = inner.x0; x < inner.x1; ++x)
                    *out++ = DepthTile::depthOf(tile.row(y)[x]);
            }
        };
        drawer_.draw(
            view, settings, [&](const SubpixelRect& inner) { return slotOf(inner) >= 0; }, false,
            take, drawn_);
        return true;
    }

    // Depths, from the sun, at which the column over a rectangle of sun space meets the scene's
    // bounds: casters outside of what the camera sees are in it. Empty (z_min > z_max): it does
    // not.
    void depthRange(const DMat3& world_from_sun, const DVec3& corner, double width, double height,
                    double& z_min, double& z_max) const {
        const DVec3 p = world_from_sun * corner, u = world_from_sun[0] * width,
                    v = world_from_sun[1] * height, along = world_from_sun[2];
        z_min = -1e30, z_max = 1e30;
        for (int i = 0; i < 3; ++i) {
            const double low = p[i] + std::min(u[i], 0.0) + std::min(v[i], 0.0),
                         high = p[i] + std::max(u[i], 0.0) + std::max(v[i], 0.0);
            const double to_first = bounds_min_[i] - high, to_last = bounds_max_[i] - low;
            if (std::abs(along[i]) < 1e-9) {
                if (to_first > 0.0 || to_last < 0.0) z_max = -1e31;
                continue;
            }
            const double a = to_first / along[i], b = to_last / along[i];
            z_min = std::max(z_min, std::min(a, b));
            z_max = std::min(z_max, std::max(a, b));
        }
    }

    const Scene& scene_;
    const View& view_;
    const DepthDrawer& drawer_;
    const RenderSettings& settings_;
    DVec3 bounds_min_, bounds_max_;
    FrameStats drawn_;
};

}  // namespace

std::unique_ptr<ShadowPages> makeShadowMaps(const Scene& scene, const View& view,
                                            const FirstLook& look, const DepthDrawer& drawer,
                                            FrameStats& stats) {
    const Stopwatch watch;
    std::unique_ptr<ShadowPages> maps = ShadowBuilder(scene, view, drawer).build(look, stats);
    stats.shadow_bytes = maps->bytes();
    stats.phases.emplace_back("shadows", watch.seconds());
    return maps;
}

}  // namespace stipple
