// SPDX-License-Identifier: Apache-2.0
// Where a grid's lines lie along u or v. Internal.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace stipple {

// Cells, each of 2^refine steps. Where there are as many cells as a table has texels, or a
// multiple, lines run through the texels' centres, where the table says what it says; a side that
// does not close on itself has further lines on its borders.
class GridLattice {
public:
    // The least multiple of the texels (0: no table) that is at least `least`.
    static double wantedCells(int texels, int least) {
        return texels > 0 ? texels * std::ceil(double(least) / texels) : least;
    }

    GridLattice(int cells, int texels, bool is_closed, int refine)
        : steps_(1 << refine), is_closed_(is_closed), finest_(1.0 / (double(cells) * steps_)) {
        const bool is_on_texels = texels > 0 && cells % texels == 0;
        const bool is_shifted = is_on_texels && cells / texels % 2 == 1;
        for (int i = 0; i <= cells; ++i) lines_.push_back((i + (is_shifted ? 0.5 : 0.0)) / cells);
        if (is_closed_ || !is_shifted) return;
        lines_.back() = 1.0;
        lines_.insert(lines_.begin(), 0.0);
    }

    int cellCount() const { return int(lines_.size()) - 1; }
    int stepsPerCell() const { return steps_; }
    double finestStep() const { return finest_; }
    // At a number of steps, 0..cellCount() * stepsPerCell().
    double unwrapped(double step) const {
        const size_t cell = std::min(size_t(step / steps_), lines_.size() - 2);
        const double share = step / steps_ - double(cell);
        return share < 1.0 ? lines_[cell] + (lines_[cell + 1] - lines_[cell]) * share
                           : lines_[cell + 1];
    }
    // Where a closed side ends it is exactly where it began.
    double at(double step) const {
        return unwrapped(is_closed_ && step == cellCount() * steps_ ? 0.0 : step);
    }

private:
    int steps_;
    bool is_closed_;
    double finest_;
    std::vector<double> lines_;
};

}  // namespace stipple
