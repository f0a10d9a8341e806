// SPDX-License-Identifier: Apache-2.0
// Looks up and shades what a subpixel of a tile shows: once a point and depth, since neighbours
// often show the same one. Used by every reconstruction that keeps the nearest.
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/reconstruction.h>

namespace stipple {

class SubpixelShader {
public:
    explicit SubpixelShader(const ReconstructionContext& context) : context_(context) {}

    // Numbers mean something else in another tile.
    void forget() { last_number_ = kNoNumber; }
    // Surface and radiance of a key that is not empty, seen at the centre of subpixel (x, y).
    void show(const SampleLookup& lookup, uint64_t key, int x, int y);
    // Surface and radiance of a point, whose position is known.
    void showPoint(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                   const Vec2& p_sub);
    const SurfaceSample& sample() const { return sample_; }
    const Vec3& radiance() const { return radiance_; }
    // Radiance of a surface that was put together elsewhere.
    Vec3 shadeSample(const SurfaceSample& sample) const;

private:
    const ReconstructionContext& context_;
    uint32_t last_number_ = kNoNumber;
    SurfaceSample sample_;
    Vec3 radiance_ = Vec3(0);
};

}  // namespace stipple
