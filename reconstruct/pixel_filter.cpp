// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/pixel_filter.h>

#include <cmath>

namespace stipple {

PixelFilter::PixelFilter(int subpixels, float sigma) : subpixels_(subpixels) {
    if (!(sigma > 0.0f)) {
        weights_.assign(size_t(subpixels), 1.0f);
        return;
    }
    constexpr float kCut = 2.5f;
    const float middle = 0.5f * float(subpixels - 1);
    // At least the subpixels at the pixel's centre.
    const float radius = std::max(kCut * sigma, 0.5f);
    first_ = int(std::ceil(middle - radius - 1e-4f));
    const int last = int(std::floor(middle + radius + 1e-4f));
    for (int i = first_; i <= last; ++i) {
        const float d = (float(i) - middle) / sigma;
        weights_.push_back(std::exp(-0.5f * d * d));
    }
}

void PixelFilter::apply(const ShadedTile& tile, const SubpixelRect& inner,
                        const std::function<void(int, int, PixelSums&)>& finish) {
    const int s = subpixels_, taps = int(weights_.size());
    const int width = inner.width() / s, height = inner.height() / s;
    const SubpixelRect& rect = tile.rect;
    const auto add = [](ShadedSubpixel& to, const ShadedSubpixel& from, float w) {
        to.radiance += from.radiance * w;
        to.covered += from.covered * w;
        to.depth += from.depth * w;
    };
    rows_.assign(size_t(width) * size_t(rect.height()), {});
    std::vector<float> total_x(size_t(width), 0.0f);
    for (int px = 0; px < width; ++px) {
        for (int i = 0; i < taps; ++i) {
            const int x = inner.x0 + px * s + first_ + i;
            if (x >= rect.x0 && x < rect.x1) total_x[size_t(px)] += weights_[size_t(i)];
        }
    }
    for (int y = rect.y0; y < rect.y1; ++y) {
        const ShadedSubpixel* from = tile.row(y);
        ShadedSubpixel* to = rows_.data() + size_t(y - rect.y0) * size_t(width);
        for (int px = 0; px < width; ++px) {
            const int begin = inner.x0 + px * s + first_;
            for (int i = std::max(0, rect.x0 - begin); i < std::min(taps, rect.x1 - begin); ++i)
                add(to[px], from[begin + i], weights_[size_t(i)]);
        }
    }
    for (int py = 0; py < height; ++py) {
        const int begin = inner.y0 + py * s + first_;
        const int i0 = std::max(0, rect.y0 - begin), i1 = std::min(taps, rect.y1 - begin);
        for (int px = 0; px < width; ++px) {
            ShadedSubpixel sum;
            float total_y = 0.0f;
            for (int i = i0; i < i1; ++i) {
                add(sum, rows_[size_t(begin + i - rect.y0) * size_t(width) + size_t(px)],
                    weights_[size_t(i)]);
                total_y += weights_[size_t(i)];
            }
            // In subpixels of the pixel, so that counts keep their meaning.
            const float scale = float(s) * float(s) / (total_x[size_t(px)] * total_y);
            PixelSums sums;
            sums.samples = float(s) * float(s);
            sums.radiance = sum.radiance * scale;
            sums.covered = sum.covered * scale;
            sums.depth = sum.depth * scale;
            const float mean = sums.covered > 0.0f ? sums.depth / sums.covered : 0.0f;
            sums.depth_max = mean;
            sums.nearest = sums.covered > 0.0f ? mean : kInfinity;
            finish(inner.x0 / s + px, inner.y0 / s + py, sums);
        }
    }
}

}  // namespace stipple
