// SPDX-License-Identifier: Apache-2.0
// The depth sink: a frame of which only the depths are wanted (shadow maps, a first look at what is
// visible). Points cover what they cover in per_pixel.h, so coverage is as right as there.
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/reconstruction.h>

#include <functional>

namespace stipple {

// Takes a finished tile; called by the thread that drew it. The depth tile has a halo around inner.
using TakeDepths = std::function<void(const SubpixelRect& inner, const DepthTile& tile)>;

// Wants view, settings and base of the context, which must outlive it. One instance a thread.
std::unique_ptr<TileReconstruction> makeDepthOnly(const ReconstructionContext& context,
                                                  const TakeDepths& take_depths);

}  // namespace stipple
