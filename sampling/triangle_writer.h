// SPDX-License-Identifier: Apache-2.0
// Triangles that are too large for points and too small for the frame's z-buffer: into the sink, 64
// at a time, and what is seen on them. Based on: Wand et al. 2001 ("Handling of large triangles").
#pragma once

#include <sampling/tile_context.h>

namespace stipple {

class TriangleWriter {
public:
    explicit TriangleWriter(TileContext& context) : context_(context) {}

    // The triangles of a leaf of a mesh. triangle_frame: index into context.frames.
    void add(uint32_t mesh, uint32_t node, uint32_t triangle_frame);

private:
    class Mask;

    // Whether holes beside the node's triangles are to be closed (kSurfaceWidth).
    bool isWide(const InstanceFrame& frame, const MeshNode& node, const Stratum& stratum) const;
    void dropBackFaces(const InstanceFrame& frame, TriangleBlock& block) const;

    TileContext& context_;
    TriangleBlock block_;
};

// Attributes of a triangle of an instance where the ray through sub_x, sub_y meets it at
// sample.depth.
void triangleAttributes(const Scene& scene, const View& view, const InstanceFrame& frame,
                        uint32_t mesh, uint32_t triangle, float sub_x, float sub_y,
                        SurfaceSample& sample);

}  // namespace stipple
