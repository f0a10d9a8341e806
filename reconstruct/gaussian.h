// SPDX-License-Identifier: Apache-2.0
// Gaussian reconstruction: weighted averages over all points of the visible surface; less noise and
// aliasing than per-pixel. Based on: Wand et al. 2001 ("Gaussian Reconstruction").
#pragma once

#include <reconstruct/reconstruction.h>

namespace stipple {

// Two passes: depth, then all points within a small slack behind it, shaded and weighted. sigma:
// settings.splat_size / 2 pixels.
std::unique_ptr<TileReconstruction> makeGaussian(const ReconstructionContext& context);

}  // namespace stipple
