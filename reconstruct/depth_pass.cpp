// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/depth_pass.h>

#include <core/rng.h>
#include <core/vector_clones.h>
#include <reconstruct/tile_triangles.h>

#include <cstring>

namespace stipple {

DepthPass::DepthPass(const ReconstructionContext& context, int splat_subpixels)
    : context_(context),
      is_splat_(splat_subpixels > 0),
      side_(is_splat_ ? splat_subpixels : 2),
      splat_world_(is_splat_ ? float(context.settings.splat_world) : 0.0f),
      footprints_(float(context.settings.samples)),
      wants_counts_(context.picture && context.picture->image().channelIndex("count") >= 0) {
    if (is_splat_) footprints_.wide_share.fill(1.0f);
}

void DepthPass::begin(const SubpixelRect& inner) {
    inner_ = inner;
    since_refresh_ = 0;
    if (wants_counts_) {
        const int s = context_.view.subpixels;
        counts_.assign(size_t(inner.width() / s) * size_t(inner.height() / s), 0);
    }
}

namespace {

// What a point covers.
constexpr int32_t kNothing = 0, kWide = 2;  // 1: the subpixel it lies in

// Where a block's points fall and what each covers. Whole vectors.
struct Placed {
    alignas(64) float x[kBlockPoints], y[kBlockPoints];  // subpixels
    alignas(64) int32_t offset[kBlockPoints];            // in the tile's keys
    alignas(64) int32_t covers[kBlockPoints];
    int kept = 0;  // within `inner`
};

// What projection needs of the tile.
struct Window {
    float focal, center_x, center_y;
    SubpixelRect tile, inner;
    int stride;
};

// A whole block, however many points are in it: a number of steps that the compiler knows. kAlike:
// all have the same footprint, of no more than the subpixel they lie in.
template <bool kOrthographic, bool kAlike>
inline __attribute__((always_inline)) void placeLoop(const Window& window, const PointBlock& block,
                                                     const FootprintTable& footprints,
                                                     Placed& placed) {
    // Plain locals, integers for truth and restricted pointers, or the compiler will not vectorize;
    // table look-ups stay out of the vector loops.
    const float focal = window.focal, center_x = window.center_x, center_y = window.center_y;
    const float left = float(window.tile.x0), right = float(window.tile.x1),
                top = float(window.tile.y0), bottom = float(window.tile.y1);
    const float inner_left = float(window.inner.x0), inner_right = float(window.inner.x1),
                inner_top = float(window.inner.y0), inner_bottom = float(window.inner.y1);
    const int x0 = window.tile.x0, y0 = window.tile.y0, stride = window.stride;
    const float* __restrict x = block.x;
    const float* __restrict y = block.y;
    const float* __restrict z = block.z;
    const uint8_t* __restrict keep = block.keep;
    float* __restrict sx = placed.x;
    float* __restrict sy = placed.y;
    int32_t* __restrict offset = placed.offset;
    int32_t* __restrict covers = placed.covers;
    alignas(64) float half_side[kBlockPoints], wide_share[kBlockPoints];
    const int count = block.count;
    for (int i = 0; !kAlike && i < kBlockPoints; ++i) {
        half_side[i] = footprints.half_side[block.width[i]];
        wide_share[i] = footprints.wide_share[block.width[i]];
    }
    const float alike_half_side = footprints.half_side[block.width[0]];
    int kept = 0;
    for (int i = 0; i < kBlockPoints; ++i) {
        const float scale = kOrthographic ? focal : focal / z[i];
        const float px = center_x + x[i] * scale, py = center_y + y[i] * scale;
        const int is_there = keep[i] & (i < count);
        const int is_in_tile = is_there & (px >= left) & (px < right) & (py >= top) & (py < bottom);
        kept += is_there & (px >= inner_left) & (px < inner_right) & (py >= inner_top) &
                (py < inner_bottom);
        // In this order what is no number, behind the block's last point, becomes the first bound.
        const int ix = int(std::min(right, std::max(left, px))),
                  iy = int(std::min(bottom, std::max(top, py)));
        const float dx = std::abs(px - float(ix) - 0.5f), dy = std::abs(py - float(iy) - 0.5f);
        const float half = kAlike ? alike_half_side : half_side[i];
        const int is_near = (dx <= half) & (dy <= half);
        sx[i] = px;
        sy[i] = py;
        offset[i] = (iy - y0) * stride + (ix - x0);
        if (kAlike) {
            covers[i] = is_in_tile * is_near;
            continue;
        }
        // The same choice in every tile that sees the point: from its coordinates.
        const uint32_t bits =
            mixBits32(std::bit_cast<uint32_t>(x[i]) * 0x9e3779b9u ^ std::bit_cast<uint32_t>(y[i]));
        const int is_wide = float(int(bits >> 8)) * 0x1p-24f < wide_share[i];
        covers[i] = is_in_tile * (is_wide * kWide | is_near);
    }
    placed.kept = kept;
}

STIPPLE_VECTOR_CLONES void placePoints(bool orthographic, const Window& window,
                                       const PointBlock& block, const FootprintTable& footprints,
                                       Placed& placed) {
    // As those of a prebuilt model are.
    const bool is_alike =
        std::memcmp(block.width, block.width + 1, size_t(std::max(block.count, 1) - 1)) == 0 &&
        !(footprints.wide_share[block.width[0]] > 0.0f);
    if (is_alike) {
        orthographic ? placeLoop<true, true>(window, block, footprints, placed)
                     : placeLoop<false, true>(window, block, footprints, placed);
    } else {
        orthographic ? placeLoop<true, false>(window, block, footprints, placed)
                     : placeLoop<false, false>(window, block, footprints, placed);
    }
}

}  // namespace

bool DepthPass::take(const PointBlock& block, DepthTile& tile) {
    const View& view = context_.view;
    const Window window = {
        float(view.focal), float(view.center_x), float(view.center_y), tile.rect(), inner_,
        tile.stride()};
    Placed placed;
    placePoints(view.orthographic, window, block, footprints_, placed);
    counters_.points_drawn += uint64_t(block.count);
    counters_.points_kept += uint64_t(placed.kept);

    int covering[kBlockPoints + 1], n_covering = 0;
    for (int i = 0; i < block.count; ++i) {
        covering[n_covering] = i;
        n_covering += placed.covers[i] != kNothing;
    }
    uint64_t* const keys = tile.keys().data();
    bool is_used = false;
    for (int k = 0; k < n_covering; ++k) {
        const int i = covering[k];
        const uint64_t key = pointKey(block, i, block.z[i]);
        if (placed.covers[i] & kWide) {
            is_used |= splat(tile, placed.x[i], placed.y[i], key, sideAt(block.z[i]));
        } else {
            uint64_t& slot = keys[placed.offset[i]];
            is_used |= key < slot;
            slot = std::min(slot, key);
        }
    }
    if (wants_counts_) {
        for (int i = 0; i < block.count; ++i) {
            if (block.keep[i]) count(placed.x[i], placed.y[i]);
        }
    }
    refreshAfter(uint64_t(n_covering), tile);
    return is_used;
}

bool DepthPass::take(const TriangleBlock& block, DepthTile& tile) {
    counters_.triangles += uint64_t(block.count);
    const uint64_t visited = rasterizeTriangles(context_.view, block, tile);
    refreshAfter(visited, tile);
    return visited > 0;
}

void DepthPass::count(float sub_x, float sub_y) {
    if (!(sub_x >= float(inner_.x0) && sub_x < float(inner_.x1) && sub_y >= float(inner_.y0) &&
          sub_y < float(inner_.y1)))
        return;
    const int s = context_.view.subpixels;
    const int px = (int(sub_x) - inner_.x0) / s, py = (int(sub_y) - inner_.y0) / s;
    ++counts_[size_t(py) * size_t(inner_.width() / s) + size_t(px)];
}

void DepthPass::addCount(int px, int py, PixelSums& sums) const {
    if (!wants_counts_) return;
    const int s = context_.view.subpixels;
    sums.points += float(counts_[size_t(py - inner_.y0 / s) * size_t(inner_.width() / s) +
                                 size_t(px - inner_.x0 / s)]);
}

// What is hidden is looked at again after every half tile of subpixels.
void DepthPass::refreshAfter(uint64_t subpixels, DepthTile& tile) {
    since_refresh_ += subpixels;
    if (since_refresh_ * 2 > uint64_t(tile.rect().width()) * uint64_t(tile.rect().height())) {
        tile.refreshHidden();
        since_refresh_ = 0;
    }
}

bool DepthPass::splat(DepthTile& tile, float sub_x, float sub_y, uint64_t key, int side) const {
    const SubpixelRect& rect = tile.rect();
    const float half = 0.5f * float(side - 1);
    const int x0 = int(std::floor(sub_x - half)), y0 = int(std::floor(sub_y - half));
    bool is_used = false;
    for (int y = std::max(y0, rect.y0); y < std::min(y0 + side, rect.y1); ++y) {
        uint64_t* row = tile.row(y);
        for (int x = std::max(x0, rect.x0); x < std::min(x0 + side, rect.x1); ++x) {
            is_used |= key < row[x];
            row[x] = std::min(row[x], key);
        }
    }
    return is_used;
}

}  // namespace stipple
