// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/gaussian.h>

#include <reconstruct/erode.h>
#include <reconstruct/front_slack.h>
#include <reconstruct/per_pixel.h>
#include <reconstruct/pixel_filter.h>
#include <reconstruct/split_pass.h>
#include <reconstruct/surface_channels.h>

namespace stipple {

namespace {

// Side of the squares that close large surfaces of k points a subpixel: odd, so that erosion takes
// back exactly what they add; six points in each, so that hardly any hole is left.
int closingSide(double k) {
    constexpr int kMost = 15;
    int side = 3;
    while (side < kMost && double(side) * double(side) * k < 6.0) side += 2;
    return side;
}

class Gaussian : public TileReconstruction {
public:
    explicit Gaussian(const ReconstructionContext& context)
        : context_(context),
          side_(closingSide(context.settings.samples)),
          split_(context_, codesFromWidth(kWideInSides * float(side_)), side_),
          filter_(context.view.subpixels, float(context.settings.splat_size) *
                                              float(context.view.subpixels) / std::sqrt(12.0f)),
          slack_(context.view) {}

    int passCount() const override { return 2; }
    // Filling looks two subpixels around, twice, and erosion as far as points reach, at what points
    // reach from further away, or at what covers them there.
    int halo() const override { return filter_.margin() + 5 + 2 * split_.reach(false); }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        tile_.reset(outer, context_.base, kZBufferBit);
        surfaces_.reset(outer, context_.base, kZBufferBit);
        split_.begin(inner);
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
        closeSurfaces();
        if (context_.settings.fill) fillHoles(tile_, context_.view, scratch_);
        tile_.refreshHidden();
    }

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling) return false;
        if (pass_ == 1) return tile_.hides(rect, slack_.frontOf(z_min));
        const auto grown = [&](int by) {
            return SubpixelRect{rect.x0 - by, rect.y0 - by, rect.x1 + by, rect.y1 + by};
        };
        // Narrow points go into tile_ alone, each into its own subpixel.
        if (narrow) return tile_.hides(rect, z_min) || surfaces_.hides(grown(side_ / 2), z_min);
        // Erosion shows nothing farther than what is there within the reach of a square, and
        // surfaces behind all that tile_ shows so far around are dropped before.
        const SubpixelRect around = grown(split_.reach(false) + side_ / 2);
        return tile_.hides(around, z_min) || surfaces_.hides(around, z_min);
    }
    const SubpixelRect& region() const override { return pass_ == 0 ? tile_.rect() : shaded_.rect; }

    bool take(const PointBlock& block) override {
        if (pass_ == 0) return split_.take(block, tile_, surfaces_).is_used;
        average(block);
        return false;
    }
    bool take(const TriangleBlock& block) override {
        return pass_ == 0 && split_.take(block, tile_);
    }

    void endTile(const SampleLookup& lookup) override {
        showFronts(lookup);
        filter_.apply(shaded_, inner_, [&](int x, int y, PixelSums& sums) {
            channels_.add(lookup, tile_, x, y, sums);
            split_.addCount(x, y, sums);
            context_.picture->write(x, y, sums);
        });
    }
    TileCounters counters() const override { return split_.counters(); }

private:
    // A patch at least this many squares wide is a surface.
    static constexpr float kWideInSides = 4.0f;

    // Large surfaces, eroded, into tile_. What hides() lets be left out must change nothing here.
    void closeSurfaces() {
        dropHiddenSurfaces();
        // A surface may go on in triangles.
        for (size_t i = 0; i < tile_.keys().size(); ++i) {
            const uint64_t key = tile_.keys()[i];
            if (DepthTile::numberOf(key) != kNoNumber && DepthTile::numberOf(key) & kAnyTriangle)
                surfaces_.keys()[i] = std::min(surfaces_.keys()[i], key);
        }
        // What is left open is a subpixel or two, erosion would make a square of it.
        if (context_.settings.fill) fillHoles(surfaces_, context_.view, scratch_);
        erodeSplats(
            surfaces_, [&](float) { return side_ / 2; }, scratch_);
        for (size_t i = 0; i < scratch_.size(); ++i) {
            uint64_t& key = tile_.keys()[i];
            const uint64_t near_key = surfaces_.keys()[i], far_key = scratch_[i];
            // Points all around: a surface goes on here, and must not sink below a triangle close
            // behind it for the depth that it gains within a square.
            const bool is_within = key < far_key && far_key != DepthTile::kEmpty &&
                                   !(DepthTile::numberOf(far_key) & kAnyTriangle) &&
                                   DepthTile::numberOf(key) & kAnyTriangle;
            key = std::min(key, is_within ? near_key : far_key);
        }
    }

    // Surfaces behind all that tile_ shows within half a square are not seen wherever erosion might
    // show them.
    void dropHiddenSurfaces() {
        farthestWithin(tile_, side_ / 2, scratch_);
        for (size_t i = 0; i < scratch_.size(); ++i) {
            uint64_t& key = surfaces_.keys()[i];
            if (DepthTile::depthOf(key) > DepthTile::depthOf(scratch_[i])) key = DepthTile::kEmpty;
        }
    }

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
            if (DepthTile::numberOf(front) & kAnyTriangle ||
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
    const int side_;  // of the squares that close large surfaces
    SplitPass split_;
    PixelFilter filter_;
    const FrontSlack slack_;
    SubpixelShader shader_{context_};
    SurfaceChannels channels_{context_};
    SubpixelRect inner_;
    DepthTile tile_;      // what each subpixel shows; before the second pass, without surfaces
    DepthTile surfaces_;  // large surfaces, closed
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
