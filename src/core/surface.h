// SPDX-License-Identifier: Apache-2.0
// What any method (points, rasterized triangles, rays) finds at a place in the picture, ready to be
// shaded.
#pragma once

#include <core/math.h>

#include <cstdint>

namespace stipple {

// How a surface treats light, beside its base colour: a material's values times its textures'.
struct SurfaceFinish {
    float metallic = 0.0f;
    float roughness = 1.0f;
    Vec3 specular = Vec3(0);     // reflectance of what is no metal, at normal incidence ...
    float specular_edge = 1.0f;  // ... and at grazing incidence
    Vec3 emissive = Vec3(0);     // linear radiance
};

struct SurfaceSample {
    float depth = kInfinity;         // camera z; infinite where there is nothing
    float extent = 1.0f;             // side of the square of the picture it stands for, subpixels
    Vec3 position_camera = Vec3(0);  // relative to the eye
    Vec3 normal_world =
        Vec3(0, 1, 0);      // unit, shading normal, on the side the asset's author gave it
    Vec3 albedo = Vec3(0);  // linear base colour: material x texture x vertex colour
    SurfaceFinish finish;
    float alpha = 1.0f;             // of blended surfaces that are drawn in layers
    float patch_width = kInfinity;  // of the connected patch (a leaf, a terrain), metres
    // What is drawn lies off the surface it stands for by about this: nothing nearer casts a shadow
    // on it. Metres, 0 where it is exact.
    float shadow_slack = 0.0f;
    uint32_t material = 0;  // index into Scene::materials
    uint32_t object = 0;    // hash of the instance path, 0 where there is nothing
};

}  // namespace stipple
