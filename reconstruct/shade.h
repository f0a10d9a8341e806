// SPDX-License-Identifier: Apache-2.0
// Shading of one surface sample: Lambert (two-sided where the material is), translucency, Phong
// lobe, suns, point and spot lights, and a sky or an environment. Done per sample (subpixel, point
// or ray) before samples are averaged into pixels, the same for every method.
#pragma once

#include <core/camera.h>
#include <core/light.h>
#include <core/material.h>
#include <core/surface.h>

namespace stipple {

// Radiance towards the eye, linear. The sample's normal is turned towards the viewer for
// double-sided materials.
Vec3 shade(const SurfaceSample& sample, const Material& material, const Lighting& lighting,
           const View& view);

// Radiance of the sky in a (world space, unit) direction.
Vec3 skyRadiance(const Sky& sky, const Vec3& direction_world);

}  // namespace stipple
