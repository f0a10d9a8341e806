// SPDX-License-Identifier: Apache-2.0
// What is seen at a point of a list.
#pragma once

#include <sampling/tile_context.h>
#include <scenegraph/surface_at.h>

namespace stipple {

// Attributes of the point in `lane` of a block of the run's list, seen at sub_x, sub_y (subpixel
// coordinates) at sample.depth; textures are filtered to a subpixel's footprint there.
void pointAttributes(const Scene& scene, const View& view, const Run& run, const ListBlock& list,
                     int lane, float sub_x, float sub_y, SurfaceSample& sample);

// Reads ahead what pointAttributes() needs of a block.
inline void prefetchAttributes(const ListBlock& list, uint32_t lane) {
    __builtin_prefetch(list.normal_or_triangle + lane);
    __builtin_prefetch(list.albedo_or_place + lane);
    __builtin_prefetch(list.material + lane);
    __builtin_prefetch(list.instance + lane);
    __builtin_prefetch(list.alpha + lane);
    __builtin_prefetch(list.width + lane);
}

// The beam through a subpixel at that depth, in a space whose lengths grow by length_scale on the
// way to the camera and whose normals go there by camera_from_normal.
LookupBeam sampleBeam(const View& view, float sub_x, float sub_y, const SurfaceSample& sample,
                      float length_scale, const Mat3& camera_from_normal);

}  // namespace stipple
