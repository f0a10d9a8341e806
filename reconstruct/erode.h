// SPDX-License-Identifier: Apache-2.0
// Takes back what splats add to silhouettes. Splatting is a dilation: each subpixel shows the
// nearest point within half a splat. The erosion after it, the farthest of what is shown within the
// same distance, makes both together a morphological closing: holes narrower than a splat stay
// closed, straight edges are where the points are.
#pragma once

#include <reconstruct/depth_tile.h>

#include <functional>
#include <vector>

namespace stipple {

// eroded: becomes the tile's keys after erosion, laid out as the tile's. reach: subpixels beyond
// its own that a splat at a depth covers on each side. Where a triangle is shown nothing changes:
// triangles are exact. Takes time proportional to subpixels x reach; the outermost subpixels of the
// tile, as many as the reach, are wrong.
void erodeSplats(const DepthTile& tile, const std::function<int(float depth)>& reach,
                 std::vector<uint64_t>& eroded);

// farthest: becomes the largest key of the square of subpixels within `reach` of each, as far as
// the tile has them; laid out as the tile's keys. Takes time proportional to subpixels x reach.
void farthestWithin(const DepthTile& tile, int reach, std::vector<uint64_t>& farthest);

}  // namespace stipple
