// SPDX-License-Identifier: Apache-2.0
// Points and triangles into the z-buffer of a tile: the first pass of every reconstruction that
// keeps the nearest. Based on: Wand et al. 2001 ("Per-Pixel Reconstruction", "Splatting").
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/footprint.h>
#include <reconstruct/reconstruction.h>

namespace stipple {

// Side of a square splat, subpixels: the nearest odd number. Erosion takes back as much on each
// side as a splat adds only if its middle is the subpixel that the point lies in.
inline int splatSide(float side) { return 2 * int(0.5f * side) + 1; }

class DepthPass {
public:
    // splat_subpixels: side of the square of constant depth that a point covers, odd where it is to
    // be eroded; 0: chosen by the patch it lies on (footprint.h).
    DepthPass(const ReconstructionContext& context, int splat_subpixels);
    void begin(const SubpixelRect& inner);
    // False if none of the block is in front.
    bool take(const PointBlock& block, DepthTile& tile);
    bool take(const TriangleBlock& block, DepthTile& tile);
    // Side of the square that a point at depth z covers: fixed, or, with settings.splat_world and
    // as a splat, of a size in the world, between 1 and the fixed size.
    int sideAt(float z) const {
        if (!(splat_world_ > 0.0f)) return side_;
        const float side =
            splat_world_ * float(context_.view.focal) / (context_.view.orthographic ? 1.0f : z);
        return std::min(splatSide(std::min(side, float(side_))), side_);
    }
    // How many subpixels beyond the one it lies in a point may cover.
    int reach(bool narrow) const { return narrow && !is_splat_ ? 0 : side_ / 2; }
    const TileCounters& counters() const { return counters_; }
    bool wantsCounts() const { return wants_counts_; }
    // Kept points of a pixel of the tile, if asked for.
    void addCount(int px, int py, PixelSums& sums) const;

private:
    bool splat(DepthTile& tile, float sub_x, float sub_y, uint64_t key, int side) const;
    void count(float sub_x, float sub_y);
    void refreshAfter(uint64_t subpixels, DepthTile& tile);

    const ReconstructionContext& context_;
    const bool is_splat_;
    const int side_;           // of the square a wide point covers
    const float splat_world_;  // metres; 0: side_ holds at any depth
    FootprintTable footprints_;
    const bool wants_counts_;
    SubpixelRect inner_;
    TileCounters counters_;
    std::vector<uint32_t> counts_;
    uint64_t since_refresh_ = 0;
};

}  // namespace stipple
