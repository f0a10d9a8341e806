// SPDX-License-Identifier: Apache-2.0
#include <render/shadow_pages.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

// Texels, at right angles to the surface.
constexpr float kBias = 1.5f;
// A surface that meets the light at less than this sine is compared as if it met it at this.
constexpr float kGrazing = 0.1f;
// Patches wider than so many texels are surfaces that a look at the picture can tell the slope of.
constexpr float kWideTexels = 8.0f;

// Depth at a texel of the rectangle; NaN where no page is.
float depthAt(const ShadowLevel& level, int x, int y) {
    const int column = x / kPageTexels, row = y / kPageTexels;
    if (x < 0 || y < 0 || column >= level.columns || row >= level.rows)
        return std::numeric_limits<float>::quiet_NaN();
    const int32_t slot = level.page_slot[size_t(row) * size_t(level.columns) + size_t(column)];
    if (slot < 0) return std::numeric_limits<float>::quiet_NaN();
    const ShadowLevel::PlacedPage& placed = level.pages[size_t(slot)];
    return placed.behind +
           placed.page->depth[size_t(y % kPageTexels) * kPageTexels + size_t(x % kPageTexels)];
}

// How much nearer to the light the same patch may be elsewhere in the texels around a sample. A
// patch much smaller than a texel has hardly another point there.
float depthOfPatch(float width, float texel) {
    return 0.5f * width * std::min(1.0f, width / texel);
}

}  // namespace

int cubeFaceOf(const Vec3& from_lamp) {
    const Vec3 size = glm::abs(from_lamp);
    const int axis = size.z >= size.x && size.z >= size.y ? 2 : size.y >= size.x ? 1 : 0;
    return 2 * axis + (from_lamp[axis] < 0.0f);
}

DMat3 cubeFaceFromLamp(int face) {
    const int axis = face / 2;
    const double sign = face % 2 ? -1.0 : 1.0;
    DMat3 lamp_from_face(0.0);
    lamp_from_face[0][(axis + 1) % 3] = 1.0;
    lamp_from_face[1][(axis + 2) % 3] = sign;
    lamp_from_face[2][axis] = sign;
    return glm::transpose(lamp_from_face);
}

int levelExponent(float width) {
    int exponent;
    std::frexp(width * float(std::sqrt(0.5)), &exponent);
    return exponent;
}

ShadowPages::ShadowPages(const View& view, double texel_pixels, std::vector<ShadowMap> suns,
                         std::vector<LampShadow> lamps)
    : orthographic_(view.orthographic),
      texel_per_depth_(float(texel_pixels * view.subpixels / view.focal)) {
    for (ShadowMap& sun : suns) suns_.push_back(makeMap(view, std::move(sun)));
    for (LampShadow& shadow : lamps) {
        Lamp lamp;
        lamp.lamp_from_camera =
            Mat3(shadow.lamp_from_world * glm::transpose(view.camera_from_world));
        lamp.eye = Vec3(shadow.lamp_from_world * (view.eye_world - shadow.position));
        for (size_t f = 0; f < kCubeFaces; ++f)
            lamp.faces[f] = makeMap(view, std::move(shadow.faces[f]));
        lamps_.push_back(std::move(lamp));
    }
}

ShadowPages::Map ShadowPages::makeMap(const View& view, ShadowMap shadow) {
    Map map;
    map.light_from_world = Mat3(shadow.light_from_world);
    map.light_from_camera = Mat3(shadow.light_from_world * glm::transpose(view.camera_from_world));
    for (const ShadowLevel& level : shadow.levels)
        map.eye.push_back(Vec3(shadow.light_from_world * view.eye_world - level.origin));
    map.shadow = std::move(shadow);
    return map;
}

template <bool kIsLamp>
float ShadowPages::litShare(const Map& map, const SurfaceSample& sample) const {
    const std::vector<ShadowLevel>& levels = map.shadow.levels;
    if (levels.empty()) return 1.0f;
    const Vec3 from_eye = map.light_from_camera * sample.position_camera;
    const Vec3 normal = map.light_from_world * sample.normal_world;
    Vec3 p = from_eye + map.eye[0];
    // Of a lamp's light: a slope's metres at the sample, and the direction in which z is 1.
    const float metres = kIsLamp ? p.z : 1.0f;
    if (!(metres > 0.0f)) return 1.0f;
    const float cosine = kIsLamp ? (normal.x * p.x + normal.y * p.y) / p.z + normal.z : normal.z;
    const float size = std::max(std::abs(cosine), kGrazing);
    const float along = cosine < 0.0f ? 1.0f / size : -1.0f / size;
    const float slope_x = normal.x * along, slope_y = normal.y * along;  // of depth, along x and y
    // Leaves have pages for what they are seen in, not for each of them.
    const float coarse = wantedTexel(sample.depth, 1.0f);
    const bool is_wide = sample.patch_width > kWideTexels * coarse;
    const float sine = std::abs(cosine) * (kIsLamp ? p.z / glm::length(p) : 1.0f);
    const float wanted_texel = is_wide ? wantedTexel(sample.depth, sine) : coarse;
    const int wanted = levelExponent(wanted_texel / metres) - map.shadow.first_exponent;
    for (size_t i = size_t(std::max(wanted, 0)); i < levels.size(); ++i) {
        const ShadowLevel& level = levels[i];
        if (level.columns == 0) continue;
        p = from_eye + map.eye[i];
        const float texel = level.texel * metres;
        const float x = p.x / texel - float(level.corner_x) - 0.5f,
                    y = p.y / texel - float(level.corner_y) - 0.5f;
        if (!(x >= 0.0f && y >= 0.0f && x < float(level.columns * kPageTexels) &&
              y < float(level.rows * kPageTexels)))
            continue;
        const int x0 = int(x), y0 = int(y);
        const float fx = x - float(x0), fy = y - float(y0);
        const float most = depthOfPatch(sample.patch_width, texel);
        const float towards_light =
            std::min(std::max(kBias * texel, sample.shadow_slack) / size, most);
        float visible = 0.0f;
        for (int k = 0; k < 4; ++k) {
            const int dx = k & 1, dy = k >> 1;
            const float to_texel =
                texel * (slope_x * (float(dx) - fx) + slope_y * (float(dy) - fy));
            const float plane = p.z + std::clamp(to_texel, -most, most) - towards_light;
            const float depth = depthAt(level, x0 + dx, y0 + dy);
            const float weight = (dx ? fx : 1.0f - fx) * (dy ? fy : 1.0f - fy);
            if (std::isnan(depth)) {
                visible = -1.0f;
                break;
            }
            visible += depth >= plane ? weight : 0.0f;
        }
        if (visible >= 0.0f) return std::min(visible, 1.0f);
    }
    return 1.0f;
}

float ShadowPages::ofSun(size_t sun, const SurfaceSample& sample) const {
    return litShare<false>(suns_[sun], sample);
}

float ShadowPages::ofLamp(size_t index, const SurfaceSample& sample) const {
    const Lamp& lamp = lamps_[index];
    const int face = cubeFaceOf(lamp.lamp_from_camera * sample.position_camera + lamp.eye);
    return litShare<true>(lamp.faces[size_t(face)], sample);
}

size_t ShadowPages::bytes() const {
    size_t bytes = 0;
    const auto add = [&](const Map& map) {
        for (const ShadowLevel& level : map.shadow.levels)
            bytes += level.pages.size() * sizeof(ShadowPage) +
                     level.page_slot.capacity() * sizeof(int32_t);
    };
    for (const Map& sun : suns_) add(sun);
    for (const Lamp& lamp : lamps_) {
        for (const Map& face : lamp.faces) add(face);
    }
    return bytes;
}

}  // namespace stipple
