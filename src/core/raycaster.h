// SPDX-License-Identifier: Apache-2.0
// Rays through a scene, as the layers below render may ask for them (building models, ambient
// occlusion, references).
#pragma once

#include <core/surface.h>

#include <cstddef>
#include <cstdint>

namespace stipple {

// A ray relative to the eye: p = origin + t * direction, world orientation. Hits with t in [t_min,
// t_max] count.
struct Ray {
    Vec3 origin;
    float t_min = 0.0f;
    Vec3 direction;
    float t_max = kInfinity;
};

struct RayHit {
    float t = kInfinity;          // infinite: nothing
    Vec3 normal_world = Vec3(0);  // unit, shading normal
    Vec3 albedo = Vec3(0);
    SurfaceFinish finish;
    uint32_t material = 0;
    uint32_t object = 0;
};

class RayCaster {
public:
    virtual ~RayCaster() = default;
    // Nearest hits of `count` rays. Thread-safe. footprint_per_t: diameter of a ray's footprint
    // grows by it per unit of t (texture filtering); 0 for none.
    virtual void cast(const Ray* rays, size_t count, RayHit* hits, float footprint_per_t) const = 0;
    // Whether anything that faces the ray's end stops it (what a light at that end would see):
    // is_hit[i] is 1 or 0. Thread-safe.
    virtual void occluded(const Ray* rays, size_t count, uint8_t* is_hit) const = 0;
    virtual size_t bytes() const = 0;
};

}  // namespace stipple
