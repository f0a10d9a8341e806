// SPDX-License-Identifier: Apache-2.0
// How much of the picture a point covers. A kept point lies in a subpixel but stands for 1/K of
// one; so that the coverage of a connected patch (a leaf, a terrain) is right in expectation
// whatever K is, its footprint depends on K and on how wide the patch is.
//
// On a patch much finer than a subpixel each point must cover 1/K of one: it counts only if it lies
// within the central square of that area, and the coverage is what rays through the centres would
// find (1 - exp(-A) for randomly placed detail); with growing K the picture goes to theirs. On a
// patch several footprints wide, holes inside balance what the border gains at a density between 1
// and 2.5 points per footprint. Large surfaces use all points, and close their holes by covering 2
// x 2 subpixels where K alone would not; their silhouettes grow by half a subpixel in exchange.
#pragma once

#include <core/points.h>

#include <array>

namespace stipple {

struct Footprint {
    float half_side =
        0.5f;  // a point counts if it is that near to a subpixel's centre along x and y
    float wide_share = 0.0f;  // share of the points that cover the 2 x 2 subpixels around them
};

// k: kept points a subpixel. width: of the patch, in subpixels.
Footprint makeFootprint(float width, float k);

// Footprints at one K for all patchWidthCode()s.
struct FootprintTable {
    explicit FootprintTable(float k);
    std::array<float, kWidthCodes> half_side, wide_share;
};

// Points per footprint at which points of one footprint each cover, in expectation, as much as a
// patch of that many footprints' width does. Fitted to a simulation of thinned stratified points on
// randomly placed squares (within 4 %).
float balancedDensity(float width);

}  // namespace stipple
