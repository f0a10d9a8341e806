// SPDX-License-Identifier: Apache-2.0
// Bins: a few layers of blended surface a pixel, put together front to back with their alpha; what
// is opaque lies behind them and is shown as with the gaussian, without its filter.
// Based on: Levoy, Whitted. The Use of Points as a Display Primitive. 1985 (bins by depth and
// facing, sums of weights that are the coverage); Carpenter. The A-buffer. 1984 (masks).
//
// A contribution, a point or a subpixel of a triangle, goes into the bin of its pixel whose range
// of depths, all taken along their planes to the pixel's middle, holds it, and that is seen from
// the same side; of two triangles at a subpixel each has a bin, however near they are. A bin sums
// up weights, alpha, and radiance times alpha. Bins that come to overlap are merged. Contributions
// go in front to back, whatever order they came in. A pixel that then has more than kMostBins has
// the two that are nearest in 1 / depth made one, the one over the other.
//
// Random points would make the sum of a pixel's weights 10 to 20 % wrong. So coverage is not their
// sum but comes from subpixels: a bin keeps a mask of those that have a contribution, and the masks
// of the bins around that continue it are closed by a square of as many subpixels as have six
// points. Only wide patches are closed. An opaque surface needs no bin, as it covers whole
// subpixels: it ends the list of layers at each one. So edges of opaque surfaces that lie beside
// each other in a pixel are not taken for layers that lie behind each other.
#pragma once

#include <reconstruct/reconstruction.h>

namespace stipple {

// Two passes; wants layers, so only what opaque surfaces hide is left out. Cost: that of the
// gaussian, and each point of a blended surface that is not behind an opaque one is shaded.
std::unique_ptr<TileReconstruction> makeBins(const ReconstructionContext& context);

}  // namespace stipple
