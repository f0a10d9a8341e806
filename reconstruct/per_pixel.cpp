// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/per_pixel.h>

#include <reconstruct/depth_pass.h>
#include <reconstruct/erode.h>
#include <reconstruct/subpixel_shader.h>

namespace stipple {

namespace {

// Numbers of the z-buffer use the bit for themselves, and it has no holes.
bool isOnSurface(uint32_t number) { return (number & kSurfaceBit) && !(number & kZBufferBit); }

// Depth from which something lies clearly behind.
struct Behind {
    float scale = 1.02f, offset = 0.0f;

    explicit Behind(const View& view) {
        if (!view.orthographic) return;
        scale = 1.0f;
        offset = 16.0f / float(view.focal);
    }
    float of(float depth) const { return depth * scale + offset; }
};

bool fillOnce(DepthTile& tile, const Behind& behind, std::vector<uint64_t>& scratch) {
    const int width = tile.rect().width(), height = tile.rect().height(), w = tile.stride();
    scratch = tile.keys();
    bool is_changed = false;
    for (int y = 1; y + 1 < height; ++y) {
        for (int x = 1; x + 1 < width; ++x) {
            const uint64_t* c = scratch.data() + size_t(y) * size_t(w) + size_t(x);
            // Opposite neighbours on a surface in front of this subpixel: something solid passes
            // here.
            const float here = DepthTile::depthOf(*c);
            // Of two neighbours at least one must be in front: most subpixels end here.
            if (!(behind.of(DepthTile::depthOf(std::min(c[-1], c[1]))) < here)) continue;
            const uint64_t around[8] = {c[-w - 1], c[-w], c[-w + 1], c[1],
                                        c[w + 1],  c[w],  c[w - 1],  c[-1]};
            int in_front = 0, on_surface = 0;
            uint64_t nearest = DepthTile::kEmpty;
            float nearest_depth = kInfinity, farthest_front = 0.0f;
            for (const uint64_t key : around) {
                const float d = DepthTile::depthOf(key);
                if (behind.of(d) < here) {
                    ++in_front;
                    on_surface += isOnSurface(DepthTile::numberOf(key));
                    farthest_front = std::max(farthest_front, d);
                    if (d < nearest_depth) nearest_depth = d, nearest = key;
                }
            }
            // All but one, and they agree on one depth within what a slanted surface spans over
            // three subpixels. Gaps between leaves are no holes.
            if (in_front >= 7 && on_surface >= 4 && farthest_front < behind.of(nearest_depth)) {
                tile.keys()[size_t(y) * size_t(w) + size_t(x)] =
                    DepthTile::pack(farthest_front, DepthTile::numberOf(nearest));
                is_changed = true;
            }
        }
    }
    return is_changed;
}

}  // namespace

void fillHoles(DepthTile& tile, const View& view, std::vector<uint64_t>& scratch) {
    // Again for holes of three subpixels and more, whose ends the first time closes.
    const Behind behind(view);
    if (fillOnce(tile, behind, scratch)) fillOnce(tile, behind, scratch);
}

namespace {

class PerPixel : public TileReconstruction {
public:
    PerPixel(const ReconstructionContext& context, int splat_subpixels)
        : context_(context),
          depth_pass_(context_, splat_subpixels),
          is_splat_(splat_subpixels > 0) {}

    int passCount() const override { return 1; }
    // Filling looks two subpixels around, at what points a reach further cover; so does erosion
    // before.
    int halo() const override { return 2 + depth_pass_.reach(false) * (is_splat_ ? 2 : 1); }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        shader_.forget();
        tile_.reset(outer, context_.base, kZBufferBit);
        depth_pass_.begin(inner);
    }
    void beginPass(int, const SampleLookup&) override {}
    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling) return false;
        const int reach = depth_pass_.reach(narrow);
        return tile_.hides({rect.x0 - reach, rect.y0 - reach, rect.x1 + reach, rect.y1 + reach},
                           z_min);
    }
    const SubpixelRect& region() const override { return tile_.rect(); }
    bool take(const PointBlock& block) override { return depth_pass_.take(block, tile_); }
    bool take(const TriangleBlock& block) override { return depth_pass_.take(block, tile_); }

    void endTile(const SampleLookup& lookup) override {
        if (is_splat_) {
            const auto reach = [&](float depth) { return (depth_pass_.sideAt(depth) - 1) / 2; };
            erodeSplats(tile_, reach, scratch_);
            tile_.keys().swap(scratch_);
        }
        if (context_.settings.fill) fillHoles(tile_, context_.view, scratch_);
        const int s = context_.view.subpixels;
        for (int py = inner_.y0 / s; py < inner_.y1 / s; ++py) {
            for (int px = inner_.x0 / s; px < inner_.x1 / s; ++px) {
                const int n_empty = countEmpty(px, py);
                if (n_empty > 0) {
                    context_.picture->writeNothing(px, py, n_empty, float(s * s), sky_);
                    px += n_empty - 1;
                    continue;
                }
                PixelSums sums;
                shader_.showPixel(lookup, tile_, px, py, [&](int, int, uint64_t key) {
                    if (DepthTile::numberOf(key) == kNoNumber) {
                        sums.addNothing();
                    } else {
                        sums.add(shader_.sample(), shader_.radiance(), DepthTile::depthOf(key));
                    }
                });
                depth_pass_.addCount(px, py, sums);
                context_.picture->write(px, py, sums, sky_);
            }
        }
    }
    TileCounters counters() const override { return depth_pass_.counters(); }

private:
    // Pixels from this one on along a row that show nothing, and have no points to be counted.
    int countEmpty(int px, int py) const {
        const int s = context_.view.subpixels, last = inner_.x1 / s;
        if (depth_pass_.wantsCounts()) return 0;
        int n = 0;
        for (; px + n < last; ++n) {
            for (int y = py * s; y < (py + 1) * s; ++y) {
                const uint64_t* row = tile_.row(y);
                for (int x = (px + n) * s; x < (px + n + 1) * s; ++x) {
                    if (DepthTile::numberOf(row[x]) != kNoNumber) return n;
                }
            }
        }
        return n;
    }

    const ReconstructionContext context_;
    DepthPass depth_pass_;
    const bool is_splat_;
    SubpixelRect inner_;
    DepthTile tile_;
    std::vector<uint64_t> scratch_;
    SkyRow sky_;
    SubpixelShader shader_{context_};
};

}  // namespace

std::unique_ptr<TileReconstruction> makePerPixel(const ReconstructionContext& context,
                                                 int splat_subpixels) {
    return std::make_unique<PerPixel>(context, splat_subpixels);
}

}  // namespace stipple
