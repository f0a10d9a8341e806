// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/gaussian.h>

#include <reconstruct/front_means.h>
#include <reconstruct/surface_channels.h>

namespace stipple {

namespace {

class Gaussian : public TileReconstruction {
public:
    explicit Gaussian(const ReconstructionContext& context)
        : context_(context),
          means_(context_),
          filter_(context.view.subpixels, float(context.settings.splat_size) *
                                              float(context.view.subpixels) / std::sqrt(12.0f)) {}

    int passCount() const override { return 2; }
    int halo() const override { return filter_.margin() + means_.halo(); }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        const int margin = filter_.margin();
        shown_ = {std::max(outer.x0, inner.x0 - margin), std::max(outer.y0, inner.y0 - margin),
                  std::min(outer.x1, inner.x1 + margin), std::min(outer.y1, inner.y1 + margin)};
        means_.beginTile(inner, shown_, outer);
        channels_.forget();
    }
    void beginPass(int pass, const SampleLookup& lookup) override {
        pass_ = pass;
        means_.beginPass(pass, lookup);
    }

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        return context_.settings.culling && means_.hides(rect, z_min, narrow);
    }
    const SubpixelRect& region() const override {
        return pass_ == 0 ? means_.fronts().rect() : shown_;
    }

    bool take(const PointBlock& block) override { return means_.take(block); }
    bool take(const TriangleBlock& block) override { return means_.take(block); }

    void endTile(const SampleLookup& lookup) override {
        const ShadedTile& shaded = means_.finish(lookup);
        filter_.apply(shaded, inner_, [&](int x, int y, PixelSums& sums) {
            channels_.add(lookup, means_.fronts(), x, y, sums);
            means_.split().addCount(x, y, sums);
            context_.picture->write(x, y, sums, sky_);
        });
    }
    TileCounters counters() const override { return means_.split().counters(); }

private:
    const ReconstructionContext context_;
    FrontMeans means_;
    SkyRow sky_;
    PixelFilter filter_;
    SurfaceChannels channels_{context_};
    SubpixelRect inner_, shown_;
    int pass_ = 0;
};

}  // namespace

std::unique_ptr<TileReconstruction> makeGaussian(const ReconstructionContext& context) {
    return std::make_unique<Gaussian>(context);
}

}  // namespace stipple
