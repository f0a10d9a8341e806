// SPDX-License-Identifier: Apache-2.0
// A sun's shadow map as shading reads it: the depths that the sun sees, in pages of texels that lie
// still in the world. Texels are powers of two of a metre, a level each; a sample takes the level
// whose texels are about a pixel at its distance from the camera. Only pages that something visible
// needs are there. Based on: Lauritzen, Salvi, Lefohn. Sample Distribution Shadow Maps. 2011;
// Lefohn, Sengupta, Owens. Resolution-Matched Shadow Maps. 2007 (pages, chosen by what is visible).
#pragma once

#include <core/camera.h>
#include <core/light.h>
#include <core/sun_visibility.h>

#include <vector>

namespace stipple {

inline constexpr int kPageTexels = 128;  // along a side

// One texel size. Sun space: x right, y down, z away from the sun, axes fixed by its direction.
struct ShadowLevel {
    float texel = 1.0f;  // metres
    // Of the rectangle that holds the pages, in sun space, metres: its corner, and the depth from
    // which stored depths count.
    DVec3 origin = DVec3(0.0);
    int columns = 0, rows = 0;       // of pages
    std::vector<int32_t> page_slot;  // columns * rows; -1: no page
    std::vector<float> depth;  // metres, page by page, rows of texels; infinite where nothing is
};

struct SunShadow {
    DMat3 sun_from_world = DMat3(1.0);
    int first_exponent = 0;           // levels[i] has texels of 2^(first_exponent + i) metres
    std::vector<ShadowLevel> levels;  // some have no pages
};

// The level whose texels are about `metres` wide: exponent of the nearest power of two.
int levelExponent(float metres);

class ShadowPages : public SunVisibility {
public:
    // texel_pixels: wanted side of a texel in pixels of the view. suns: as in Lighting::suns.
    ShadowPages(const View& view, double texel_pixels, std::vector<SunShadow> suns);

    // Percentage-closer: of the 2 x 2 texels around the sample, weighted by nearness, those that do
    // not see anything in front of it. 1 where no page is. Every texel is compared with the plane
    // through the sample along its normal, moved towards the sun by kBias texels: a point that made
    // a texel lies up to a texel beside its centre. Closer than that nothing casts a shadow.
    float of(size_t sun, const SurfaceSample& sample) const override;

    // Side of a texel that a surface at a depth asks for, metres.
    float wantedTexel(float depth) const {
        return orthographic_ ? texel_per_depth_ : texel_per_depth_ * depth;
    }
    size_t bytes() const;

private:
    struct Sun {
        SunShadow shadow;
        Mat3 sun_from_camera = Mat3(1.0f), sun_from_world = Mat3(1.0f);
        std::vector<Vec3> eye;  // by level: the camera's place in the level's rectangle, metres
    };

    bool orthographic_ = false;
    float texel_per_depth_ = 0.0f;
    std::vector<Sun> suns_;
};

}  // namespace stipple
