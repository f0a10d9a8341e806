// SPDX-License-Identifier: Apache-2.0
// EWA reconstruction: points as oriented elliptical splats. Visibility pass, attribute pass,
// normalization, deferred shading.
// Based on: Ni. Hybrid 3D-Model Representation through Quadric Metrics and Hardware Accelerated
// Point-Based Rendering. UMBC MSc thesis, 2005; Zwicker, Pfister, van Baar, Gross. EWA Splatting.
// 2002; Levoy, Whitted. The Use of Points as a Display Primitive. 1985 (weights that sum up to
// coverage).
//
// Points on surfaces much wider than a splat are discs facing their normal, of the area they stand
// for. The visibility pass draws discs large enough to close the surface into a z-buffer. The
// attribute pass adds up albedo and normal, weighed by J V J^T + prefilter, of all splats whose
// plane lies on the front; what a subpixel gathers is normalized and shaded once. Weights are
// normalized by area, so that their sum is 1 within a surface and 1/2 on its edge: the discs' rim
// beyond it is given back to what lies behind. Points on smaller patches cover what footprint.h
// says. Foliage so looks as with the other methods. Where points suffice, subpixels are split as
// for the gaussian (drawnSettings() in reconstruction.h).
#pragma once

#include <reconstruct/reconstruction.h>

namespace stipple {

// Two passes. Settings: ewa_prefilter. Cost: a point on a large surface writes about 10 subpixels
// in each pass.
std::unique_ptr<TileReconstruction> makeEwa(const ReconstructionContext& context);

}  // namespace stipple
