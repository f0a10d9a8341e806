// SPDX-License-Identifier: Apache-2.0
// Shading of one surface sample: projected pictures, Lambert (two-sided where the material is),
// translucency, a microfacet lobe, suns, point and spot lights, and a sky or an environment. Done
// per sample (subpixel, point or ray) before samples are averaged into pixels, the same for every
// method. Based on: Khronos. glTF 2.0 Specification. 2021 (appendix B: BRDF Implementation).
#pragma once

#include <core/ambient_visibility.h>
#include <core/camera.h>
#include <core/light.h>
#include <core/light_visibility.h>
#include <core/material.h>
#include <core/surface.h>

#include <algorithm>
#include <cmath>

namespace stipple {

// Radiance towards the eye, linear. The sample's normal is turned towards the viewer for
// double-sided materials. lights: null: nothing casts shadows. ambient: darkens what comes from sky
// or environment; null: nothing does.
Vec3 shade(const SurfaceSample& sample, const Material& material, const Lighting& lighting,
           const View& view, const LightVisibility* lights = nullptr,
           const AmbientVisibility* ambient = nullptr);

// The two parts of a surface's BRDF, without translucency: what a light's irradiance on a surface
// that faces it is multiplied with, but for the cosine. normal, to_light, to_eye: unit vectors;
// null where light or eye are behind the surface.
struct Brdf {
    Vec3 diffuse = Vec3(0);
    Vec3 specular = Vec3(0);
};
Brdf evaluateBrdf(const Vec3& albedo, const SurfaceFinish& finish, const Vec3& normal,
                  const Vec3& to_light, const Vec3& to_eye);

// Of a sky without an environment: the share of the zenith's colour or, below the horizon, the
// ground's, where the rest is the horizon's. up: height of the direction, unit. Vectorizes.
inline float skyShare(float up) {
    // A soft horizon: ground's colour is reached 10 degrees below it.
    const float below = std::min(1.0f, -up * 5.7f), above = std::sqrt(std::max(up, 0.0f));
    return up < 0.0f ? below : above;
}

// Radiance of the sky in a (world space, unit) direction.
Vec3 skyRadiance(const Sky& sky, const Vec3& direction_world);

}  // namespace stipple
