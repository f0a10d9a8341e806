// SPDX-License-Identifier: Apache-2.0
// Small triangles straight into a tile's z-buffer, at subpixel centres.
// why: OSMesa sees a frame's triangles before the tiles and cannot skip what tiles find hidden;
// near foliage has tens of millions of triangles of a few subpixels of which most are hidden.
#pragma once

#include <core/camera.h>
#include <reconstruct/depth_tile.h>

namespace stipple {

// Draws the block's triangles, both sides. Returns the subpixels looked at.
uint64_t rasterizeTriangles(const View& view, const TriangleBlock& block, DepthTile& tile);

}  // namespace stipple
