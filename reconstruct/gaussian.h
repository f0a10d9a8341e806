// SPDX-License-Identifier: Apache-2.0
// Gaussian reconstruction: weighted averages over all points of the visible surface; less noise and
// aliasing than per-pixel. Based on: Wand et al. 2001 ("Gaussian Reconstruction").
//
// A first pass finds the front of every subpixel, as per-pixel does. A second one averages, within
// each subpixel, all points that lie on its front: no farther from it than the patch a point lies
// on is wide, so depth decides what belongs together. A Gaussian over the subpixels then makes the
// pixels. So a place counts by the area that is seen of it: were points weighed one by one, dense
// foliage, whose leaves lie behind each other, would outweigh the bright ground in its gaps.
// Where points suffice, the tile is drawn at more subpixels than asked for, with as many points
// (drawnSettings() in reconstruction.h): what a pixel shows of an edge then follows from where its
// points lie.
#pragma once

#include <reconstruct/reconstruction.h>

namespace stipple {

// The Gaussian has the variance of a box of settings.splat_size pixels. Cost: a point is drawn
// twice if it may be visible, and looked up and shaded if it is.
std::unique_ptr<TileReconstruction> makeGaussian(const ReconstructionContext& context);

}  // namespace stipple
