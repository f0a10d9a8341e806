// SPDX-License-Identifier: Apache-2.0
// Ambient occlusion from a picture of depths: short rays from the sample, of which a few places
// each are looked up. What is outside of the picture, or hidden behind what the picture shows, is
// not known to it. Based on: Mittring. Finding Next Gen: CryEngine 2. 2007; McGuire, Mara, Luebke.
// Scalable Ambient Obscurance. 2012.
#pragma once

#include <core/ambient_visibility.h>
#include <render/depth_drawer.h>

#include <array>

namespace stipple {

// Where a sample looks: rays about the normal, which is z, and places along each. In units of the
// radius; place number step * kRays + ray.
struct OcclusionProbes {
    static constexpr int kRays = 2, kSteps = 4, kCount = kRays * kSteps;
    alignas(64) std::array<float, kCount> x, y, z;
};

class ScreenOcclusion : public AmbientVisibility {
public:
    // view: of the picture that is shaded; the look's has the same eye. radius: metres.
    ScreenOcclusion(const View& view, FirstLook look, double radius);

    float of(const SurfaceSample& sample, const Vec3& normal_world) const override;

private:
    static constexpr int kPatternSide = 8;  // of patterns along a pixel: each looks elsewhere

    View view_;
    FirstLook look_;
    float radius_;
    Mat3 camera_from_world_;
    std::array<OcclusionProbes, size_t(kPatternSide) * kPatternSide> patterns_;
};

}  // namespace stipple
