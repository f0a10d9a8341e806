// SPDX-License-Identifier: Apache-2.0
// From shaded samples to pixels: box-filtered sums and the picture's channels. Used by every
// method.
#pragma once

#include <core/camera.h>
#include <core/image.h>
#include <core/light.h>
#include <core/surface.h>

#include <array>
#include <string>
#include <vector>

namespace stipple {

// What one pixel gathers over its samples (subpixels or rays).
struct PixelSums {
    Vec3 radiance = Vec3(0);  // sum over samples with surface
    Vec3 normal = Vec3(0);
    Vec3 albedo = Vec3(0);
    float depth = 0.0f;  // sum
    float depth_max = 0.0f;
    float nearest = kInfinity;
    uint32_t object = 0;   // of the nearest sample
    float covered = 0.0f;  // samples with surface
    float samples = 0.0f;  // samples
    float points = 0.0f;   // kept points that fell into the pixel

    void add(const SurfaceSample& s, const Vec3& shaded) { add(s, shaded, s.depth); }
    // With the depth of a place nearby.
    void add(const SurfaceSample& s, const Vec3& shaded, float at_depth) {
        radiance += shaded;
        normal += s.normal_world;
        albedo += s.albedo;
        depth += at_depth;
        depth_max = std::max(depth_max, at_depth);
        if (at_depth < nearest) nearest = at_depth, object = s.object;
        covered += 1.0f;
        samples += 1.0f;
    }
    void addNothing() { samples += 1.0f; }
};

// The sky behind some pixels of a row: what a thread keeps from one pixel of a picture to the next,
// since many cost little more than one.
struct SkyRow {
    static constexpr int kPixels = 32;
    int x = 0, y = -1, count = 0;  // the first pixel; none yet
    alignas(64) std::array<float, kPixels> red, green, blue;

    bool has(int at_x, int at_y) const { return at_y == y && at_x >= x && at_x < x + count; }
};

// Lays out channels and finishes pixels: R, G, B, A, then the AOVs in the order asked for.
class Picture {
public:
    // aovs: depth (adds depth_max), normal, albedo, object, coverage, count. Throws
    // kInvalidArgument for another name.
    Picture(const View& view, const Lighting& lighting, const std::vector<std::string>& aovs,
            bool transparent);
    // Background where samples saw nothing; exposure applied. Pixels may be written in parallel,
    // each thread with a SkyRow of its own; fast where x goes up along a row.
    void write(int x, int y, const PixelSums& sums, SkyRow& sky);
    // The same for `count` pixels from x on where all of `samples` saw nothing.
    void writeNothing(int x, int y, int count, float samples, SkyRow& sky);
    Image& image() { return image_; }
    // Keeps the sums of one pixel for the description below.
    void watch(int x, int y) { watched_x_ = x, watched_y_ = y; }
    bool isWatched(int x, int y) const { return x == watched_x_ && y == watched_y_; }
    // One line on what was found in the watched pixel.
    std::string watchedPixel() const;

private:
    void findSky(int x, int y, SkyRow& sky) const;

    View view_;
    std::vector<float> ray_x_;  // of rays through the middles of pixels of a column, camera space
    Lighting lighting_;
    bool transparent_;
    float exposure_;
    Image image_;
    int depth_, normal_, albedo_, object_, coverage_, count_;
    int watched_x_ = -1, watched_y_ = -1;
    PixelSums watched_;
};

}  // namespace stipple
