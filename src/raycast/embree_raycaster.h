// SPDX-License-Identifier: Apache-2.0
// The yardstick: the scene ray-cast by Embree, the only place that knows it. Innermost groups (of
// meshes only) use Embree's one instance level, groups that are placed once are dissolved into the
// one above; what is nested deeper are user geometries whose callbacks transform the ray and trace
// the child scene.
#pragma once

#include <core/parallel.h>
#include <core/raycaster.h>
#include <scenegraph/scene.h>

#include <memory>

namespace stipple {

// Commits all levels with high build quality. Transforms are taken relative to origin_world (the
// eye), so rays are in the coordinates of core/raycaster.h. The scene must be built, and outlive
// the caster. n_threads: for building (0: one a core). Throws kOutOfMemory, kUnsupported (groups
// nested deeper than 64 levels), kInternal. Memory O(|SG|): about 330 bytes an instance of a mesh,
// 85 to 135 one of a group, 67 a triangle.
//
// Alpha masks are looked up in the finest texels: the mean of a cut mask is not the cut mean.
// Blended surfaces stop a share alpha of the rays, as a pure function of the ray and the place.
std::unique_ptr<RayCaster> makeEmbreeRayCaster(const Scene& scene, const DVec3& origin_world,
                                               int n_threads);

}  // namespace stipple
