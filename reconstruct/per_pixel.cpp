// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/per_pixel.h>

#include <core/rng.h>
#include <reconstruct/shade.h>
#include <reconstruct/tile_triangles.h>

#include <array>

namespace stipple {

DepthPass::DepthPass(const ReconstructionContext& context, int splat_subpixels)
    : context_(context),
      splat_subpixels_(splat_subpixels),
      footprints_(float(context.settings.samples)),
      wants_counts_(context.picture->image().channelIndex("count") >= 0) {}

void DepthPass::begin(const SubpixelRect& inner) {
    inner_ = inner;
    since_refresh_ = 0;
    if (wants_counts_) {
        const int s = context_.view.subpixels;
        counts_.assign(size_t(inner.width() / s) * size_t(inner.height() / s), 0);
    }
}

namespace {

template <bool kOrthographic>
inline __attribute__((always_inline)) void projectLoop(const View& view, const PointBlock& block,
                                                       const SubpixelRect& rect,
                                                       float* __restrict sx, float* __restrict sy,
                                                       uint8_t* __restrict inside) {
    const float focal = float(view.focal), cx = float(view.center_x), cy = float(view.center_y);
    const float left = float(rect.x0), right = float(rect.x1), top = float(rect.y0),
                bottom = float(rect.y1);
    const float* __restrict x = block.x;
    const float* __restrict y = block.y;
    const float* __restrict z = block.z;
    const uint8_t* __restrict keep = block.keep;
    const int count = block.count;
    for (int i = 0; i < count; ++i) {
        const float scale = kOrthographic ? focal : focal / z[i];
        const float px = cx + x[i] * scale, py = cy + y[i] * scale;
        sx[i] = px;
        sy[i] = py;
        inside[i] = uint8_t(keep[i] & (px >= left) & (px < right) & (py >= top) & (py < bottom));
    }
}

// Subpixel coordinates, and which kept points lie within the tile.
__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default"))) void projectPoints(
    const View& view, const PointBlock& block, const SubpixelRect& rect, float* sx, float* sy,
    uint8_t* inside) {
    view.orthographic ? projectLoop<true>(view, block, rect, sx, sy, inside)
                      : projectLoop<false>(view, block, rect, sx, sy, inside);
}

}  // namespace

bool DepthPass::take(const PointBlock& block, DepthTile& tile) {
    const View& view = context_.view;
    const SubpixelRect& rect = tile.rect();
    float sx[kBlockPoints], sy[kBlockPoints];
    uint8_t inside[kBlockPoints];
    projectPoints(view, block, rect, sx, sy, inside);
    int kept[kBlockPoints + 1], n_kept = 0;
    for (int i = 0; i < block.count; ++i) {
        kept[n_kept] = i;
        n_kept += inside[i];
    }
    // Footprints by stratum: constant within a block.
    Footprint footprints[16];
    if (splat_subpixels_ == 0) {
        for (int s = 0; s < block.patch_count; ++s) footprints[s] = footprints_.of(block.patch[s]);
    }
    counters_.points_drawn += uint64_t(block.count);
    bool is_used = false;
    for (int k = 0; k < n_kept; ++k) {
        const int i = kept[k];
        const int ix = int(sx[i]), iy = int(sy[i]);
        const uint32_t number = block.first_number + uint32_t(i);
        const bool is_mine = ix >= inner_.x0 && ix < inner_.x1 && iy >= inner_.y0 && iy < inner_.y1;
        counters_.points_kept += is_mine;
        if (wants_counts_ && is_mine) {
            const int s = view.subpixels;
            ++counts_[size_t((iy - inner_.y0) / s) * size_t(inner_.width() / s) +
                      size_t((ix - inner_.x0) / s)];
        }
        if (splat_subpixels_ > 0) {
            is_used |= splat(tile, sx[i], sy[i], block.z[i], number, splat_subpixels_);
            continue;
        }
        // The same choice in every tile that sees the point: from its coordinates, not its number.
        const Footprint& footprint = footprints[block.stratum[i]];
        const float share = footprint.wide_share;
        const bool is_wide =
            share >= 1.0f ||
            (share > 0.0f &&
             uniformFloat(mixBits(std::bit_cast<uint32_t>(block.x[i]) * 0x9e3779b9ull ^
                                  std::bit_cast<uint32_t>(block.y[i]))) < share);
        if (is_wide) {
            is_used |= splat(tile, sx[i], sy[i], block.z[i], number, 2);
        } else if (std::abs(sx[i] - float(ix) - 0.5f) <= footprint.half_side &&
                   std::abs(sy[i] - float(iy) - 0.5f) <= footprint.half_side) {
            uint64_t& slot = tile.row(iy)[ix];
            const uint64_t key = DepthTile::pack(block.z[i], number);
            is_used |= key < slot;
            slot = std::min(slot, key);
        }
    }
    refreshAfter(uint64_t(n_kept), tile);
    return is_used;
}

bool DepthPass::take(const TriangleBlock& block, DepthTile& tile) {
    counters_.triangles += uint64_t(block.count);
    const uint64_t visited = rasterizeTriangles(context_.view, block, tile);
    refreshAfter(visited, tile);
    return visited > 0;
}

// What is hidden is looked at again after every half tile of subpixels.
void DepthPass::refreshAfter(uint64_t subpixels, DepthTile& tile) {
    since_refresh_ += subpixels;
    if (since_refresh_ * 2 > uint64_t(tile.rect().width()) * uint64_t(tile.rect().height())) {
        tile.refreshHidden();
        since_refresh_ = 0;
    }
}

bool DepthPass::splat(DepthTile& tile, float sub_x, float sub_y, float depth, uint32_t number,
                      int side) const {
    const SubpixelRect& rect = tile.rect();
    const float half = 0.5f * float(side - 1);
    const int x0 = int(std::floor(sub_x - half)), y0 = int(std::floor(sub_y - half));
    const uint64_t key = DepthTile::pack(depth, number);
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

namespace {

bool fillOnce(DepthTile& tile, std::vector<uint64_t>& scratch) {
    const int width = tile.rect().width(), height = tile.rect().height(), w = tile.stride();
    scratch = tile.keys();
    bool is_changed = false;
    for (int y = 1; y + 1 < height; ++y) {
        for (int x = 1; x + 1 < width; ++x) {
            const uint64_t* c = scratch.data() + size_t(y) * size_t(w) + size_t(x);
            // Opposite neighbours on a surface in front of this subpixel: something solid passes
            // here.
            const float here = DepthTile::depthOf(*c);
            const uint64_t around[8] = {c[-w - 1], c[-w], c[-w + 1], c[1],
                                        c[w + 1],  c[w],  c[w - 1],  c[-1]};
            int in_front = 0;
            uint64_t nearest = DepthTile::kEmpty;
            float nearest_depth = kInfinity, farthest_front = 0.0f;
            for (const uint64_t key : around) {
                const float d = DepthTile::depthOf(key);
                if (d * 1.02f < here) {
                    ++in_front;
                    farthest_front = std::max(farthest_front, d);
                    if (d < nearest_depth) nearest_depth = d, nearest = key;
                }
            }
            // All but one, and they agree on one depth within what a slanted surface spans over
            // three subpixels.
            if (in_front >= 7 && farthest_front < nearest_depth * 1.02f) {
                tile.keys()[size_t(y) * size_t(w) + size_t(x)] =
                    DepthTile::pack(farthest_front, DepthTile::numberOf(nearest));
                is_changed = true;
            }
        }
    }
    return is_changed;
}

}  // namespace

void fillHoles(DepthTile& tile, std::vector<uint64_t>& scratch) {
    // Again for holes of three subpixels and more, whose ends the first time closes.
    if (fillOnce(tile, scratch)) fillOnce(tile, scratch);
}

namespace {

class PerPixel : public TileReconstruction {
public:
    PerPixel(const ReconstructionContext& context, int splat_subpixels)
        : context_(context),
          depth_pass_(context_, splat_subpixels),
          splat_subpixels_(splat_subpixels) {}

    int passCount() const override { return 1; }
    int halo() const override { return std::max(2, splat_subpixels_ / 2 + 1); }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        last_number_ = kNoNumber;
        tile_.reset(outer, context_.base, kZBufferBit);
        depth_pass_.begin(inner);
    }
    void beginPass(int, const SampleLookup&) override {}
    bool hides(const SubpixelRect& rect, float z_min) override {
        if (!context_.settings.culling) return false;
        // Points reach beyond the rectangle they lie in.
        const int reach = halo();
        return tile_.hides({rect.x0 - reach, rect.y0 - reach, rect.x1 + reach, rect.y1 + reach},
                           z_min);
    }
    const SubpixelRect& region() const override { return tile_.rect(); }
    bool take(const PointBlock& block) override { return depth_pass_.take(block, tile_); }
    bool take(const TriangleBlock& block) override { return depth_pass_.take(block, tile_); }

    void endTile(const SampleLookup& lookup) override {
        if (context_.settings.fill) fillHoles(tile_, scratch_);
        const int s = context_.view.subpixels;
        for (int py = inner_.y0 / s; py < inner_.y1 / s; ++py) {
            for (int px = inner_.x0 / s; px < inner_.x1 / s; ++px) {
                PixelSums sums;
                for (int y = py * s; y < (py + 1) * s; ++y) {
                    const uint64_t* row = tile_.row(y);
                    for (int x = px * s; x < (px + 1) * s; ++x)
                        addSubpixel(lookup, row[x], x, y, sums);
                }
                if (!depth_pass_.counts().empty()) {
                    sums.points =
                        depth_pass_
                            .counts()[size_t(py - inner_.y0 / s) * size_t(inner_.width() / s) +
                                      size_t(px - inner_.x0 / s)];
                }
                context_.picture->write(px, py, sums);
            }
        }
    }
    TileCounters counters() const override { return depth_pass_.counters(); }

private:
    // Shading is per subpixel.
    void addSubpixel(const SampleLookup& lookup, uint64_t key, int x, int y, PixelSums& sums) {
        const uint32_t number = DepthTile::numberOf(key);
        if (number == kNoNumber) {
            sums.addNothing();
            return;
        }
        // Neighbours often show the same point.
        if (number != last_number_ || (number & kKindBits)) {
            last_.depth = DepthTile::depthOf(key);
            const float sub_x = float(x) + 0.5f, sub_y = float(y) + 0.5f;
            Vec3 origin, direction;
            context_.view.ray(sub_x, sub_y, origin, direction);
            last_.position_camera = origin + direction * last_.depth;
            lookup.lookUp(number, sub_x, sub_y, last_);
            last_shaded_ = shade(last_, (*context_.materials)[last_.material], *context_.lighting,
                                 context_.view);
            last_number_ = number;
        }
        sums.add(last_, last_shaded_);
    }

    const ReconstructionContext context_;
    DepthPass depth_pass_;
    const int splat_subpixels_;
    SubpixelRect inner_;
    DepthTile tile_;
    std::vector<uint64_t> scratch_;
    uint32_t last_number_ = kNoNumber;
    SurfaceSample last_;
    Vec3 last_shaded_ = Vec3(0);
};

}  // namespace

std::unique_ptr<TileReconstruction> makePerPixel(const ReconstructionContext& context,
                                                 int splat_subpixels) {
    return std::make_unique<PerPixel>(context, splat_subpixels);
}

}  // namespace stipple
