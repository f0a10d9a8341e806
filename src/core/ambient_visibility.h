// SPDX-License-Identifier: Apache-2.0
// Ambient occlusion as shading sees it: how much of the surroundings' light reaches a surface. Who
// knows what is near (rays, a picture of depths) answers; shading only asks.
#pragma once

#include <core/surface.h>

namespace stipple {

class AmbientVisibility {
public:
    virtual ~AmbientVisibility() = default;
    // Cosine-weighted share of the hemisphere about `normal_world` (unit) in which nothing lies
    // near the sample, 0 to 1. The normal is the sample's or its opposite. Thread-safe.
    virtual float of(const SurfaceSample& sample, const Vec3& normal_world) const = 0;
};

}  // namespace stipple
