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

// Depth at a texel of the rectangle; NaN where no page is.
float depthAt(const ShadowLevel& level, int x, int y) {
    const int column = x / kPageTexels, row = y / kPageTexels;
    if (x < 0 || y < 0 || column >= level.columns || row >= level.rows)
        return std::numeric_limits<float>::quiet_NaN();
    const int32_t slot = level.page_slot[size_t(row) * size_t(level.columns) + size_t(column)];
    if (slot < 0) return std::numeric_limits<float>::quiet_NaN();
    return level.depth[(size_t(slot) * kPageTexels + size_t(y % kPageTexels)) * kPageTexels +
                       size_t(x % kPageTexels)];
}

// How much nearer to the sun the same patch may be elsewhere in the texels around a sample. A patch
// much smaller than a texel has hardly another point there.
float depthOfPatch(float width, float texel) {
    return 0.5f * width * std::min(1.0f, width / texel);
}

}  // namespace

int levelExponent(float metres) {
    int exponent;
    std::frexp(metres * float(std::sqrt(0.5)), &exponent);
    return exponent;
}

ShadowPages::ShadowPages(const View& view, double texel_pixels, std::vector<SunShadow> suns)
    : orthographic_(view.orthographic),
      texel_per_depth_(float(texel_pixels * view.subpixels / view.focal)) {
    for (SunShadow& shadow : suns) {
        Sun sun;
        sun.sun_from_world = Mat3(shadow.sun_from_world);
        sun.sun_from_camera = Mat3(shadow.sun_from_world * glm::transpose(view.camera_from_world));
        for (const ShadowLevel& level : shadow.levels)
            sun.eye.push_back(Vec3(shadow.sun_from_world * view.eye_world - level.origin));
        sun.shadow = std::move(shadow);
        suns_.push_back(std::move(sun));
    }
}

float ShadowPages::of(size_t sun_index, const SurfaceSample& sample) const {
    const Sun& sun = suns_[sun_index];
    const std::vector<ShadowLevel>& levels = sun.shadow.levels;
    const Vec3 from_eye = sun.sun_from_camera * sample.position_camera;
    const Vec3 normal = sun.sun_from_world * sample.normal_world;
    const float sine = std::max(std::abs(normal.z), kGrazing);
    const float along = normal.z < 0.0f ? 1.0f / sine : -1.0f / sine;
    const float slope_x = normal.x * along, slope_y = normal.y * along;  // of depth, along x and y
    const int wanted = levelExponent(wantedTexel(sample.depth)) - sun.shadow.first_exponent;
    for (size_t i = size_t(std::max(wanted, 0)); i < levels.size(); ++i) {
        const ShadowLevel& level = levels[i];
        if (level.columns == 0) continue;
        const Vec3 p = from_eye + sun.eye[i];
        const float x = p.x / level.texel - 0.5f, y = p.y / level.texel - 0.5f;
        if (!(x >= 0.0f && y >= 0.0f && x < float(level.columns * kPageTexels) &&
              y < float(level.rows * kPageTexels)))
            continue;
        const int x0 = int(x), y0 = int(y);
        const float fx = x - float(x0), fy = y - float(y0);
        const float most = depthOfPatch(sample.patch_width, level.texel);
        float visible = 0.0f;
        for (int k = 0; k < 4; ++k) {
            const int dx = k & 1, dy = k >> 1;
            const float to_texel =
                level.texel * (slope_x * (float(dx) - fx) + slope_y * (float(dy) - fy));
            const float plane = p.z + std::clamp(to_texel, -most, most) -
                                std::min(kBias * level.texel / sine, most);
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

size_t ShadowPages::bytes() const {
    size_t bytes = 0;
    for (const Sun& sun : suns_) {
        for (const ShadowLevel& level : sun.shadow.levels)
            bytes += level.depth.capacity() * sizeof(float) +
                     level.page_slot.capacity() * sizeof(int32_t);
    }
    return bytes;
}

}  // namespace stipple
