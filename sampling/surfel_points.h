// SPDX-License-Identifier: Apache-2.0
// Draws prebuilt models: blocks that may be seen, at the density that the view asks for; where the
// finest is too coarse, discs in place of points. Based on: Grossman. Point Sample Rendering. 1998,
// chapters 6 (visibility masks and cones) and 7 (warping).
#pragma once

#include <sampling/tile_context.h>

namespace stipple {

class SurfelPoints {
public:
    explicit SurfelPoints(TileContext& context) : context_(context) {}

    // Draws an instance of a mesh that has surfels. z_min: of its nearest point, camera space.
    // False, and nothing drawn, if it is so far that the mesh that stands for it is as good.
    // Blocks are left out that lie outside of the sink's region, behind what it shows, or that show
    // their back only. Cost: O(blocks of the level) and what is drawn.
    bool draw(uint32_t mesh, const InstanceFrame& frame, float z_min);

private:
    struct Placed;

    // Subpixels between points: each covers 1/K of one.
    float wantedSpacing() const;
    // The block of that index, unless it is hidden.
    void drawBlock(const Placed& placed, size_t index, float reach);
    bool findNear(const Placed& placed, const SurfelBlock& block, float reach);
    void drawPoints(const Placed& placed, const SurfelBlock& block);
    void unpackDiscs(const SurfelLevel& level, const SurfelBlock& block);
    void addWidths(const Placed& placed, const SurfelBlock& block);
    void addShapes(const Placed& placed, const SurfelBlock& block);
    void drawDiscs(const Placed& placed, const SurfelBlock& block);
    uint32_t addRun(const Placed& placed, uint32_t first, int numbers_shift);

    TileContext& context_;
    PointBlock block_;
    TriangleBlock triangles_;
    std::array<DiscShape, kBlockPoints> shapes_;
    // Of a block whose discs are drawn; normals of the planes these lie in.
    std::array<Surfel, kBlockSurfels> surfels_;
    std::array<Vec3, kBlockSurfels> planes_;
    // Of a block, for sinks that want surfels: those too near to be ellipses, drawn as polygons.
    std::array<uint8_t, kBlockSurfels> is_near_ = {};
    bool has_near_ = false;
};

// Attributes of a surfel of a run (Run::surfel_level) at sample.position_camera.
void surfelAttributes(const TileContext& context, const Run& run, uint32_t index,
                      SurfaceSample& sample);

}  // namespace stipple
