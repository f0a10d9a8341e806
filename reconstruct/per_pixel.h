// SPDX-License-Identifier: Apache-2.0
// Per-pixel reconstruction and splatting: points into a z-buffer of subpixels, occlusion removal,
// filling. Based on: Wand et al. 2001 ("Per-Pixel Reconstruction", "Splatting").
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/reconstruction.h>

namespace stipple {

// splat_subpixels: side of the square of constant depth that a point covers (the largest, with
// settings.splat_world), taken back at silhouettes (erode.h); 0: chosen by the patch it lies on
// (per-pixel).
std::unique_ptr<TileReconstruction> makePerPixel(const ReconstructionContext& context,
                                                 int splat_subpixels);

// Occlusion removal and filling in one: a subpixel that is empty, or shows something clearly behind
// what most of its neighbours agree to be one surface, takes a neighbour's point.
// Clearly behind: by 2 % of the depth in perspective, by four subpixels in orthographic views.
void fillHoles(DepthTile& tile, const View& view, std::vector<uint64_t>& scratch);

}  // namespace stipple
