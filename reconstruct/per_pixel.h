// SPDX-License-Identifier: Apache-2.0
// Per-pixel reconstruction and splatting: points into a z-buffer of subpixels, occlusion removal,
// filling. Based on: Wand et al. 2001 ("Per-Pixel Reconstruction", "Splatting").
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/footprint.h>
#include <reconstruct/reconstruction.h>

namespace stipple {

// splat_subpixels: side of the square of constant depth that a point covers; 0: chosen by the patch
// it lies on (per-pixel).
std::unique_ptr<TileReconstruction> makePerPixel(const ReconstructionContext& context,
                                                 int splat_subpixels);

// Writes points into a depth tile. Shared by all reconstructions that begin with a depth pass.
class DepthPass {
public:
    DepthPass(const ReconstructionContext& context, int splat_subpixels);
    void begin(const SubpixelRect& inner);
    // False if none of the block is in front.
    bool take(const PointBlock& block, DepthTile& tile);
    bool take(const TriangleBlock& block, DepthTile& tile);
    const TileCounters& counters() const { return counters_; }
    const std::vector<uint16_t>& counts() const {
        return counts_;
    }  // kept points a pixel of the tile, if asked for

private:
    bool splat(DepthTile& tile, float sub_x, float sub_y, float depth, uint32_t number,
               int side) const;

    void refreshAfter(uint64_t subpixels, DepthTile& tile);

    const ReconstructionContext& context_;
    int splat_subpixels_;
    FootprintTable footprints_;
    bool wants_counts_;
    SubpixelRect inner_;
    TileCounters counters_;
    std::vector<uint16_t> counts_;
    uint64_t since_refresh_ = 0;
};

// Occlusion removal and filling in one: a subpixel that is empty, or shows something clearly behind
// what most of its neighbours agree to be one surface, takes a neighbour's point.
void fillHoles(DepthTile& tile, std::vector<uint64_t>& scratch);

}  // namespace stipple
