// SPDX-License-Identifier: Apache-2.0
// Shadow maps as shading reads them: the depths that a light sees, in pages of texels that lie
// still in the world. Texel sizes are powers of two, a level each; a sample takes the level whose
// texels are about a pixel at its distance from the camera. Only pages that something visible needs
// are there. Based on: Lauritzen, Salvi, Lefohn. Sample Distribution Shadow Maps. 2011; Lefohn,
// Sengupta, Owens. Resolution-Matched Shadow Maps. 2007 (pages, chosen by what is visible).
#pragma once

#include <core/camera.h>
#include <core/light.h>
#include <core/light_visibility.h>

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

namespace stipple {

inline constexpr int kPageTexels = 128;  // along a side

// Light space: depth z away from the light.
struct ShadowPage {
    double origin_z = 0.0;  // light space, metres: from which depths count
    // Metres, rows of texels; infinite where nothing is.
    std::array<float, size_t(kPageTexels) * kPageTexels> depth;

    ShadowPage() { depth.fill(kInfinity); }
};

// One texel size. Texels of a sun's are metres of x and y; those of a lamp's are slopes, x/z and
// y/z from the lamp.
struct ShadowLevel {
    struct PlacedPage {
        std::shared_ptr<const ShadowPage> page;
        float behind = 0.0f;  // metres that its depths count from, beyond the level's origin
    };
    float texel = 1.0f;  // metres or slope
    // In light space, metres: a sun's corner of the rectangle that holds the pages, and the least
    // depth from which one's depths count; a lamp's place.
    DVec3 origin = DVec3(0.0);
    double corner_x = 0.0, corner_y = 0.0;  // of the rectangle, from the origin, texels
    int columns = 0, rows = 0;              // of pages
    std::vector<int32_t> page_slot;         // columns * rows; -1: no page
    std::vector<PlacedPage> pages;
};

// Of a sun, or of a face of the cube around a lamp.
struct ShadowMap {
    DMat3 light_from_world = DMat3(1.0);
    int first_exponent = 0;           // levels[i] has texels of 2^(first_exponent + i)
    std::vector<ShadowLevel> levels;  // some have no pages
};

// The cube around a lamp: one face looks along a spot's axis, so that most spots need no other.
inline constexpr int kCubeFaces = 6;
struct LampShadow {
    DVec3 position = DVec3(0.0);         // world
    DMat3 lamp_from_world = DMat3(1.0);  // rotation: the cube's axes
    std::array<ShadowMap, kCubeFaces> faces;
};
// The face through which a direction in the lamp's space goes, and the rotation from the lamp's
// into the face's light space.
int cubeFaceOf(const Vec3& from_lamp);
DMat3 cubeFaceFromLamp(int face);

// The level whose texels are about that wide: exponent of the nearest power of two.
int levelExponent(float width);

class ShadowPages : public LightVisibility {
public:
    // texel_pixels: wanted side of a texel in pixels of the view. suns and lamps: as in Lighting.
    ShadowPages(const View& view, double texel_pixels, std::vector<ShadowMap> suns,
                std::vector<LampShadow> lamps);

    // Percentage-closer: of the 2 x 2 texels around the sample, weighted by nearness, those that do
    // not see anything in front of it. 1 where no page is. Every texel is compared with the plane
    // through the sample along its normal, moved towards the light by kBias texels, or by the
    // sample's slack if that is more: a point that made a texel lies up to a texel beside its
    // centre. Closer than that nothing casts a shadow.
    float ofSun(size_t sun, const SurfaceSample& sample) const override;
    float ofLamp(size_t lamp, const SurfaceSample& sample) const override;

    // Side of a texel that a surface at a depth asks for, metres. Where the light meets it at a
    // small sine a texel covers more of it, so it asks for finer ones.
    float wantedTexel(float depth, float sine) const {
        const float share = std::clamp(2.0f * sine, kFinestShare, 1.0f);
        return share * (orthographic_ ? texel_per_depth_ : texel_per_depth_ * depth);
    }
    size_t bytes() const;

private:
    static constexpr float kFinestShare = 0.25f;

    struct Map {
        ShadowMap shadow;
        Mat3 light_from_camera = Mat3(1.0f), light_from_world = Mat3(1.0f);
        std::vector<Vec3> eye;  // by level: the camera's place from the level's origin, metres
    };
    struct Lamp {
        std::array<Map, kCubeFaces> faces;
        Mat3 lamp_from_camera = Mat3(1.0f);
        Vec3 eye = Vec3(0.0f);  // the camera's place in the lamp's space
    };
    static Map makeMap(const View& view, ShadowMap shadow);
    template <bool kIsLamp>
    float litShare(const Map& map, const SurfaceSample& sample) const;

    bool orthographic_ = false;
    float texel_per_depth_ = 0.0f;
    std::vector<Map> suns_;
    std::vector<Lamp> lamps_;
};

}  // namespace stipple
