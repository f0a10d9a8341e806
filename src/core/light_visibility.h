// SPDX-License-Identifier: Apache-2.0
// Shadows as shading sees them: how much of a light reaches a surface. Who knows the scene (shadow
// maps, rays) answers; shading and reconstruction only ask.
#pragma once

#include <core/surface.h>

#include <cstddef>

namespace stipple {

class LightVisibility {
public:
    virtual ~LightVisibility() = default;
    // Share of the light of Lighting::suns[sun] that reaches the sample, 0 to 1. Thread-safe.
    virtual float ofSun(size_t sun, const SurfaceSample& sample) const = 0;
    // Of lampsOf(lighting)[lamp].
    virtual float ofLamp(size_t lamp, const SurfaceSample& sample) const = 0;
};

}  // namespace stipple
