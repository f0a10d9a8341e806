// SPDX-License-Identifier: Apache-2.0
// From shaded subpixels of a tile to pixels of the picture, through a separable filter: the box
// over the pixel, or a Gaussian of any radius. Filters end at the picture's edges and are
// normalized there.
#pragma once

#include <core/points.h>
#include <reconstruct/picture.h>

#include <functional>
#include <vector>

namespace stipple {

// Values are premultiplied: 0 where nothing is.
struct ShadedSubpixel {
    Vec3 radiance = Vec3(0);
    float covered = 0.0f;
    float depth = 0.0f;
};

// The subpixels of a rectangle, row by row.
struct ShadedTile {
    SubpixelRect rect;
    std::vector<ShadedSubpixel> data;

    void reset(const SubpixelRect& r) {
        rect = r;
        data.assign(size_t(r.width()) * size_t(r.height()), {});
    }
    ShadedSubpixel* row(int y) {
        return data.data() + size_t(y - rect.y0) * size_t(rect.width()) - rect.x0;
    }
    const ShadedSubpixel* row(int y) const {
        return data.data() + size_t(y - rect.y0) * size_t(rect.width()) - rect.x0;
    }
};

class PixelFilter {
public:
    // subpixels: along a side of a pixel. sigma: of the Gaussian, in subpixels, which is cut off at
    // 2.5 sigma; 0: a box.
    PixelFilter(int subpixels, float sigma);
    // Subpixels beyond a pixel that it looks at.
    int margin() const { return std::max(0, -first_); }
    // Weight of the subpixels along one axis, from `first` relative to the pixel's first subpixel.
    const std::vector<float>& weights() const { return weights_; }
    int first() const { return first_; }

    // finish(x, y, sums): called for every pixel of `inner` (subpixels, whole pixels), in picture
    // coordinates, with radiance, coverage and depth in place.
    void apply(const ShadedTile& tile, const SubpixelRect& inner,
               const std::function<void(int x, int y, PixelSums& sums)>& finish);

private:
    int subpixels_;
    int first_ = 0;
    std::vector<float> weights_;
    std::vector<ShadedSubpixel> rows_;  // filtered along x
};

}  // namespace stipple
