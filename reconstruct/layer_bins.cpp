// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/layer_bins.h>

#include <reconstruct/front_means.h>

#include <algorithm>
#include <bit>
#include <numeric>
#include <tuple>

namespace stipple {

namespace {

constexpr int kMostCells = 8;  // so that a pixel's are 64 bits

}  // namespace

// A layer as one pixel sees it: bins of the pixel itself and of those around that continue it.
struct LayerBins::Layer {
    Bin own, around;  // sums
    float q = 0.0f, tolerance = 0.0f;
    Vec2 slope = Vec2(0);
    uint64_t cells = 0;          // covered ones of the pixel
    std::vector<uint64_t> rows;  // cells of all the pixels, those to be closed
};

void LayerBins::Bin::merge(const Bin& o) {
    if (weight == 0.0f) {
        *this = o;
        return;
    }
    q_low = std::min(q_low, o.q_low), q_high = std::max(q_high, o.q_high);
    nearest = std::min(nearest, o.nearest);
    weight += o.weight;
    q += o.q;
    slope += o.slope;
    alpha += o.alpha;
    radiance += o.radiance;
    closed |= o.closed, exact |= o.exact, triangles |= o.triangles;
}

LayerBins::LayerBins(const View& view, double k)
    : subpixels_(view.subpixels),
      cells_(std::min(view.subpixels, kMostCells)),
      radius_(closingSide(k * view.subpixels * view.subpixels / double(cells_ * cells_)) / 2),
      reach_((2 * radius_ + cells_ - 1) / cells_),
      orthographic_(view.orthographic),
      focal_(float(view.focal)),
      picture_width_(view.width),
      picture_height_(view.height) {}

void LayerBins::reset(const SubpixelRect& rect) {
    x0_ = rect.x0 / subpixels_, y0_ = rect.y0 / subpixels_;
    width_ = rect.width() / subpixels_, height_ = rect.height() / subpixels_;
    const size_t n = size_t(width_) * size_t(height_);
    if (bins_.size() < n) bins_.resize(n);
    for (std::vector<Bin>& bins : bins_) bins.clear();
    added_.clear();
}

void LayerBins::setFronts(const DepthTile& fronts, const SubpixelRect& rect) {
    const int s = subpixels_;
    const int left = rect.x0 / s, top = rect.y0 / s, columns = rect.width() / s,
              rows = rect.height() / s;
    std::vector<float> own(size_t(columns) * size_t(rows), 0.0f), along(own.size());
    for (int y = 0; y < rows * s; ++y) {
        const uint64_t* row = fronts.row(top * s + y) + left * s;
        float* to = own.data() + size_t(y / s) * size_t(columns);
        for (int x = 0; x < columns * s; ++x)
            to[x / s] = std::max(to[x / s], DepthTile::depthOf(row[x]));
    }
    for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < columns; ++x) {
            float& to = along[size_t(y) * size_t(columns) + size_t(x)];
            for (int i = std::max(0, x - reach_); i < std::min(columns, x + reach_ + 1); ++i)
                to = std::max(to, own[size_t(y) * size_t(columns) + size_t(i)]);
        }
    }
    farthest_.assign(size_t(width_) * size_t(height_), 0.0f);
    for (int y = y0_; y < y0_ + height_; ++y) {
        for (int x = x0_; x < x0_ + width_; ++x) {
            float& to = farthest_[pixelIndex(x, y)];
            for (int i = std::max(top, y - reach_); i < std::min(top + rows, y + reach_ + 1); ++i)
                to = std::max(to, along[size_t(i - top) * size_t(columns) + size_t(x - left)]);
        }
    }
}

// What a surface gains in depth within half a subpixel, and a subpixel's width.
float LayerBins::tolerance(const Bin& bin) const {
    const Vec2 slope = bin.slope / bin.weight;
    const float width = orthographic_ ? 1.0f / focal_ : bin.middle() / focal_;
    return width + 0.5f * (std::abs(slope.x) + std::abs(slope.y));
}

// One bin for both: where their cells overlap the other one lies behind this one. Surfaces that are
// closed are taken to cover the pixel.
void LayerBins::Bin::putBefore(const Bin& o) {
    const auto cellsOf = [](const Bin& b) { return b.closed ? ~uint64_t(0) : b.exact; };
    const uint64_t own = cellsOf(*this), others = cellsOf(o);
    const float both = float(std::popcount(own & others)), all = float(std::popcount(own | others)),
                own_share = float(std::popcount(own)) / all,
                others_share = float(std::popcount(others)) / all;
    const float mean = alpha / weight, others_mean = o.alpha / o.weight;
    const float lost = both / all * mean;  // of the other one
    const float new_alpha = mean * own_share + others_mean * (others_share - lost);
    const Vec3 new_radiance =
        radiance / weight * own_share + o.radiance / o.weight * (others_share - lost);
    merge(o);
    alpha = new_alpha * weight;
    radiance = new_radiance * weight;
}

// Bins of a pixel that has all its contributions: no more than there may be.
void LayerBins::limit(std::vector<Bin>& bins) const {
    if (bins.size() <= size_t(kMostBins)) return;
    std::stable_sort(bins.begin(), bins.end(), [&](const Bin& a, const Bin& b) {
        return orthographic_ ? a.middle() < b.middle() : a.middle() > b.middle();
    });
    while (bins.size() > size_t(kMostBins)) {
        size_t best = 0;
        float least = kInfinity;
        for (size_t i = 0; i + 1 < bins.size(); ++i) {
            const float distance = std::abs(bins[i].middle() - bins[i + 1].middle());
            if (distance < least) least = distance, best = i;
        }
        bins[best].putBefore(bins[best + 1]);
        bins.erase(bins.begin() + ptrdiff_t(best) + 1);
    }
}

void LayerBins::add(int x, int y, const Contribution& c) {
    const int s = subpixels_, px = x / s, py = y / s;
    const int cell = (y - py * s) * cells_ / s * cells_ + (x - px * s) * cells_ / s;
    added_.push_back({uint32_t(pixelIndex(px, py)), uint32_t(cell), c});
}

void LayerBins::fillBins() {
    // By pixel, then by what they are, as any order that depends on nothing else will do.
    std::vector<uint32_t>& end = pixel_end_;
    end.assign(size_t(width_) * size_t(height_) + 1, 0);
    for (const Added& added : added_) ++end[added.pixel + 1];
    std::partial_sum(end.begin(), end.end(), end.begin());
    sorted_.resize(added_.size());
    for (const Added& added : added_) sorted_[end[added.pixel]++] = added;
    added_.clear();
    const auto key = [](const Added& a) {
        return std::tuple(a.c.depth, a.cell, a.c.at.x, a.c.at.y, a.c.q, a.c.slope.x, a.c.slope.y,
                          a.c.faces_eye, a.c.is_closed, a.c.alpha, a.c.radiance.x, a.c.radiance.y,
                          a.c.radiance.z);
    };
    uint32_t begin = 0;
    for (size_t pixel = 0; pixel + 1 < end.size(); ++pixel) {
        std::sort(sorted_.begin() + begin, sorted_.begin() + end[pixel],
                  [&](const Added& a, const Added& b) {
                      return a.c.depth != b.c.depth ? a.c.depth < b.c.depth : key(a) < key(b);
                  });
        for (; begin < end[pixel]; ++begin) bin(sorted_[begin]);
        limit(bins_[pixel]);
    }
}

void LayerBins::bin(const Added& added) {
    const Contribution& c = added.c;
    const Vec2 middle =
        (Vec2(float(x0_ + int(added.pixel) % width_), float(y0_ + int(added.pixel) / width_)) +
         0.5f) *
        float(subpixels_);
    Bin bin;
    bin.q = c.q + glm::dot(c.slope, middle - c.at);
    bin.q_low = bin.q_high = bin.q;
    bin.nearest = c.depth;
    bin.weight = 1.0f;
    bin.slope = c.slope;
    bin.alpha = c.alpha;
    bin.radiance = c.radiance * c.alpha;
    bin.faces_eye = c.faces_eye;
    (c.is_closed ? bin.closed : bin.exact) = uint64_t(1) << added.cell;
    if (c.is_triangle && cells_ == subpixels_) bin.triangles = uint64_t(1) << added.cell;

    std::vector<Bin>& bins = bins_[added.pixel];
    const float t = tolerance(bin);
    const auto holds = [&](const Bin& b) {
        return b.faces_eye == bin.faces_eye && bin.q >= b.q_low - t && bin.q <= b.q_high + t &&
               !(b.triangles & bin.triangles);
    };
    const auto found = std::find_if(bins.begin(), bins.end(), holds);
    if (found == bins.end()) {
        bins.push_back(bin);
        return;
    }
    found->merge(bin);
    // Bins that now overlap.
    for (size_t i = bins.size(); i-- > 0;) {
        Bin& other = bins[i];
        Bin& to = *found;
        if (&other <= &to || other.faces_eye != to.faces_eye || other.q_low > to.q_high ||
            other.q_high < to.q_low || (other.triangles & to.triangles))
            continue;
        to.merge(other);
        bins.erase(bins.begin() + ptrdiff_t(i));
    }
}

void LayerBins::gatherLayers(int px, int py, std::vector<Layer>& layers) const {
    layers.clear();
    const int side = 2 * reach_ + 1;
    const auto addBin = [&](Layer& layer, const Bin& bin, int dx, int dy) {
        if (dx == 0 && dy == 0) {
            layer.own.merge(bin);
            layer.cells |= bin.exact;
        } else {
            layer.around.merge(bin);
        }
        for (int row = 0; row < cells_; ++row) {
            const uint64_t bits = bin.closed >> (row * cells_) & ((uint64_t(1) << cells_) - 1);
            layer.rows[size_t((dy + reach_) * cells_ + row)] |= bits << ((dx + reach_) * cells_);
        }
    };
    const auto visit = [&](int dx, int dy) {
        const int x = px + dx, y = py + dy;
        if (x < x0_ || x >= x0_ + width_ || y < y0_ || y >= y0_ + height_) return;
        const bool is_own = dx == 0 && dy == 0;
        for (const Bin& bin : bins_[pixelIndex(x, y)]) {
            if (!is_own && !bin.closed) continue;
            const Vec2 slope = bin.slope / bin.weight;
            const float q =
                bin.middle() - glm::dot(slope, Vec2(float(dx), float(dy))) * float(subpixels_);
            Layer* nearest = nullptr;
            for (Layer& layer : layers) {
                const Bin& known = layer.own.weight > 0.0f ? layer.own : layer.around;
                if (is_own || known.faces_eye != bin.faces_eye ||
                    std::abs(q - layer.q) > layer.tolerance ||
                    (nearest && std::abs(q - nearest->q) <= std::abs(q - layer.q)))
                    continue;
                nearest = &layer;
            }
            if (!nearest) {
                layers.emplace_back();
                nearest = &layers.back();
                nearest->q = q;
                nearest->slope = slope;
                nearest->tolerance =
                    tolerance(bin) * float(1 + reach_) + 0.5f * (bin.q_high - bin.q_low);
                nearest->rows.assign(size_t(side * cells_), 0);
            }
            addBin(*nearest, bin, dx, dy);
        }
    };
    visit(0, 0);
    for (int dy = -reach_; dy <= reach_; ++dy) {
        for (int dx = -reach_; dx <= reach_; ++dx) {
            if (dx != 0 || dy != 0) visit(dx, dy);
        }
    }
}

// The cells of a pixel that lie within the closing of a layer's. Cells beyond the picture do not
// count.
uint64_t LayerBins::closedCells(const Layer& layer, int px, int py) const {
    const int side = (2 * reach_ + 1) * cells_;
    const int left = std::max(0, (reach_ - px) * cells_), top = std::max(0, (reach_ - py) * cells_),
              right = std::min(side, (picture_width_ - px + reach_) * cells_),
              bottom = std::min(side, (picture_height_ - py + reach_) * cells_);
    const uint64_t valid =
        ((right == 64 ? 0 : uint64_t(1) << right) - 1) & ~((uint64_t(1) << left) - 1);
    const int first = reach_ * cells_;  // of the pixel's own rows and columns
    uint64_t result = 0;
    for (int row = first; row < first + cells_; ++row) {
        uint64_t eroded = ~uint64_t(0);
        for (int e = std::max(top, row - radius_); e <= std::min(bottom - 1, row + radius_); ++e) {
            uint64_t dilated = 0;
            for (int d = std::max(top, e - radius_); d <= std::min(bottom - 1, e + radius_); ++d)
                dilated |= layer.rows[size_t(d)];
            for (int k = 0; k < radius_; ++k) dilated |= dilated << 1 | dilated >> 1;
            eroded &= dilated | ~valid;
        }
        for (int k = 0; k < radius_; ++k) eroded &= eroded << 1 & eroded >> 1;
        const uint64_t own = eroded >> first & ((uint64_t(1) << cells_) - 1);
        result |= own << ((row - first) * cells_);
    }
    return result;
}

void LayerBins::composite(const DepthTile& fronts, const SubpixelRect& inner, ShadedTile& shaded) {
    fillBins();
    const int s = subpixels_;
    struct Shown {
        float q, opacity, nearest;
        Vec2 slope;
        Vec3 radiance;
        uint64_t cells;
    };
    std::vector<Layer> layers;
    std::vector<Shown> shown;
    for (int py = inner.y0 / s; py < inner.y1 / s; ++py) {
        for (int px = inner.x0 / s; px < inner.x1 / s; ++px) {
            gatherLayers(px, py, layers);
            shown.clear();
            for (const Layer& layer : layers) {
                const uint64_t cells = layer.cells | closedCells(layer, px, py);
                const Bin& bin = layer.own.weight > 0.0f ? layer.own : layer.around;
                if (!cells || !(bin.alpha > 0.0f)) continue;
                shown.push_back({layer.q, bin.alpha / bin.weight,
                                 std::min(layer.own.nearest, layer.around.nearest), layer.slope,
                                 bin.radiance / bin.alpha, cells});
            }
            if (shown.empty()) continue;
            // Front to back.
            std::sort(shown.begin(), shown.end(), [&](const Shown& a, const Shown& b) {
                return orthographic_ ? a.q < b.q : a.q > b.q;
            });
            const Vec2 middle = (Vec2(float(px), float(py)) + 0.5f) * float(s);
            for (int y = py * s; y < (py + 1) * s; ++y) {
                ShadedSubpixel* row = shaded.row(y);
                for (int x = px * s; x < (px + 1) * s; ++x) {
                    const int cell = (y - py * s) * cells_ / s * cells_ + (x - px * s) * cells_ / s;
                    const float front = DepthTile::depthOf(fronts.row(y)[x]);
                    const Vec2 d = Vec2(float(x) + 0.5f, float(y) + 0.5f) - middle;
                    ShadedSubpixel sum;
                    float left = 1.0f;  // of the light from behind
                    for (const Shown& layer : shown) {
                        if (!(layer.cells >> cell & 1)) continue;
                        const float q = layer.q + glm::dot(layer.slope, d);
                        const float depth = std::max(orthographic_ ? q
                                                     : q > 0.0f    ? 1.0f / q
                                                                   : kInfinity,
                                                     layer.nearest);
                        if (depth > front) continue;
                        const float share = left * layer.opacity;
                        sum.radiance += layer.radiance * share;
                        sum.depth += depth * share;
                        left -= share;
                    }
                    const ShadedSubpixel& behind = row[x];
                    sum.radiance += behind.radiance * left;
                    sum.depth += behind.depth * left;
                    sum.covered = 1.0f - left + behind.covered * left;
                    row[x] = sum;
                }
            }
        }
    }
}

}  // namespace stipple
