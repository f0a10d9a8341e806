// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/gaussian.h>

#include <reconstruct/depth_pass.h>
#include <reconstruct/front_slack.h>
#include <reconstruct/per_pixel.h>
#include <reconstruct/pixel_filter.h>
#include <reconstruct/surface_channels.h>

namespace stipple {

namespace {

class Gaussian : public TileReconstruction {
public:
    explicit Gaussian(const ReconstructionContext& context)
        : context_(context),
          depth_pass_(context_, 0),
          filter_(context.view.subpixels, float(context.settings.splat_size) *
                                              float(context.view.subpixels) / std::sqrt(12.0f)),
          slack_(context.view) {}

    int passCount() const override { return 2; }
    // Filling looks two subpixels around, at what points a reach further cover.
    int halo() const override { return filter_.margin() + 2 + depth_pass_.reach(false); }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        tile_.reset(outer, context_.base, kZBufferBit);
        depth_pass_.begin(inner);
        const int margin = filter_.margin();
        shaded_.reset({std::max(outer.x0, inner.x0 - margin), std::max(outer.y0, inner.y0 - margin),
                       std::min(outer.x1, inner.x1 + margin),
                       std::min(outer.y1, inner.y1 + margin)});
        shader_.forget();
        channels_.forget();
    }

    void beginPass(int pass, const SampleLookup& lookup) override {
        pass_ = pass;
        lookup_ = &lookup;
        if (pass == 0) return;
        if (context_.settings.fill) fillHoles(tile_, scratch_);
        tile_.refreshHidden();
    }

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling) return false;
        if (pass_ == 1) return tile_.hides(rect, slack_.frontOf(z_min));
        const int reach = depth_pass_.reach(narrow);
        return tile_.hides({rect.x0 - reach, rect.y0 - reach, rect.x1 + reach, rect.y1 + reach},
                           z_min);
    }
    const SubpixelRect& region() const override { return pass_ == 0 ? tile_.rect() : shaded_.rect; }

    bool take(const PointBlock& block) override {
        if (pass_ == 0) return depth_pass_.take(block, tile_);
        average(block);
        return false;
    }
    bool take(const TriangleBlock& block) override {
        return pass_ == 0 && depth_pass_.take(block, tile_);
    }

    void endTile(const SampleLookup& lookup) override {
        showFronts(lookup);
        filter_.apply(shaded_, inner_, [&](int x, int y, PixelSums& sums) {
            channels_.add(lookup, tile_, x, y, sums);
            depth_pass_.addCount(x, y, sums);
            context_.picture->write(x, y, sums);
        });
    }
    TileCounters counters() const override { return depth_pass_.counters(); }

private:
    // Sums of the points on each subpixel's front; `covered` counts them.
    void average(const PointBlock& block) {
        const View& view = context_.view;
        const SubpixelRect& rect = shaded_.rect;
        for (int i = 0; i < block.count; ++i) {
            if (!block.keep[i]) continue;
            const Vec3 p_camera(block.x[i], block.y[i], block.z[i]);
            const Vec2 p = view.project(p_camera);
            if (!(p.x >= float(rect.x0) && p.x < float(rect.x1) && p.y >= float(rect.y0) &&
                  p.y < float(rect.y1)))
                continue;
            const int x = int(p.x), y = int(p.y);
            const uint64_t front = tile_.row(y)[x];
            // A triangle is exact, it needs no points.
            if (DepthTile::numberOf(front) & kKindBits ||
                !slack_.isOnFront(block.z[i], DepthTile::depthOf(front), block.width[i]))
                continue;
            shader_.showPoint(*lookup_, p_camera, block.number[i], p);
            ShadedSubpixel& sum = shaded_.row(y)[x];
            sum.radiance += shader_.radiance();
            sum.covered += 1.0f;
        }
    }

    // Means, and the front itself where no point lies in the subpixel.
    void showFronts(const SampleLookup& lookup) {
        shader_.forget();
        for (int y = shaded_.rect.y0; y < shaded_.rect.y1; ++y) {
            const uint64_t* keys = tile_.row(y);
            ShadedSubpixel* row = shaded_.row(y);
            for (int x = shaded_.rect.x0; x < shaded_.rect.x1; ++x) {
                if (DepthTile::numberOf(keys[x]) == kNoNumber) continue;
                if (row[x].covered > 0.0f) {
                    row[x].radiance /= row[x].covered;
                } else {
                    shader_.show(lookup, keys[x], x, y);
                    row[x].radiance = shader_.radiance();
                }
                row[x].covered = 1.0f;
                row[x].depth = DepthTile::depthOf(keys[x]);
            }
        }
    }

    const ReconstructionContext context_;
    DepthPass depth_pass_;
    PixelFilter filter_;
    const FrontSlack slack_;
    SubpixelShader shader_{context_};
    SurfaceChannels channels_{context_};
    SubpixelRect inner_;
    DepthTile tile_;
    ShadedTile shaded_;
    std::vector<uint64_t> scratch_;
    int pass_ = 0;
    const SampleLookup* lookup_ = nullptr;
};

}  // namespace

std::unique_ptr<TileReconstruction> makeGaussian(const ReconstructionContext& context) {
    return std::make_unique<Gaussian>(context);
}

}  // namespace stipple
