// SPDX-License-Identifier: Apache-2.0
// Tables of numbers that move a grid's points, with mip levels.
#pragma once

#include <core/math.h>

#include <vector>

namespace stipple {

struct GridTable {
    struct Level {
        int width = 0, height = 0;
        std::vector<Vec3> texels;  // row by row
    };
    std::vector<Level> levels;  // from fine to coarse, each half as large, rounded up

    // place: (0, 0) is the table's first corner, (1, 1) its last; texels hold at their centres.
    // Beyond its sides the table is repeated, or the border's texel goes on. Of the levels whose
    // texels are as wide as `footprint` (the larger side in texels counts), cubic within a level
    // (Catmull, Rom): slopes are continuous, so a finer grid always has a smoother surface.
    DVec3 at(DVec2 place, DVec2 footprint, bool repeats_x, bool repeats_y) const;
};

// texels: width * height, finite.
GridTable makeGridTable(int width, int height, std::vector<Vec3> texels);

}  // namespace stipple
