// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/pull_push.h>

#include <reconstruct/level_depths.h>
#include <reconstruct/pixel_filter.h>
#include <reconstruct/pull_push_fill.h>
#include <reconstruct/split_pass.h>
#include <reconstruct/surface_channels.h>

namespace stipple {

namespace {

class PullPush : public TileReconstruction {
public:
    explicit PullPush(const ReconstructionContext& context)
        : context_(context),
          levels_(context.view, levelOfDensity(context.settings.samples),
                  context.settings.pull_push_coverage, context.settings.pull_push_threshold),
          split_(context_, levels_.hasLevel(), 1),
          filter_(context.view.subpixels, 0.0f) {}

    int passCount() const override { return 1; }
    // What pull and push carry, and cells around it that say what is covered.
    int halo() const override {
        return std::max(split_.reach(false), (3 + 4) << levels_.highest());
    }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        hits_.reset(outer, context_.base, kZBufferBit);
        levels_.reset(outer);
        split_.begin(inner);
        points_since_refresh_ = 0;
        shader_.forget();
        channels_.forget();
    }
    void beginPass(int, const SampleLookup&) override {}

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling) return false;
        if (levels_.highest() > 0 && levels_.hides(rect, z_min)) return true;
        // What covers no more than its subpixel; else what its cells cover, too.
        const int reach = narrow ? 0 : split_.reach(false) + (4 << levels_.highest());
        return hits_.hides({rect.x0 - reach, rect.y0 - reach, rect.x1 + reach, rect.y1 + reach},
                           z_min);
    }
    const SubpixelRect& region() const override { return hits_.rect(); }

    bool take(const PointBlock& block) override {
        const SplitPass::Taken taken = split_.take(block, hits_, hits_);
        if (taken.wide > 0) enterLevels(block);
        return taken.is_used;
    }
    bool take(const TriangleBlock& block) override { return split_.take(block, hits_); }

    void endTile(const SampleLookup& lookup) override {
        levels_.finish(hits_, context_.settings.samples);
        weigh(lookup);
        PullPushRules rules;
        rules.levels = levels_.highest();
        rules.slope = levels_.slope();
        rules.orthographic = context_.view.orthographic;
        rules.coverage = [&](int x, int y, float depth) {
            return levels_.coverage(region_.x0 + x, region_.y0 + y, depth);
        };
        pullPush(weighted_, rules);
        shaded_.reset(inner_);
        for (int y = inner_.y0; y < inner_.y1; ++y) {
            const float* from =
                weighted_.values.data() + (size_t(y - region_.y0) * size_t(weighted_.width) +
                                           size_t(inner_.x0 - region_.x0)) *
                                              kChannels;
            for (int x = inner_.x0; x < inner_.x1; ++x, from += kChannels)
                shaded_.row(y)[x] = {Vec3(from[0], from[1], from[2]), from[3], from[4]};
        }
        filter_.apply(shaded_, inner_, [&](int x, int y, PixelSums& sums) {
            channels_.add(lookup, hits_, x, y, sums);
            split_.addCount(x, y, sums);
            context_.picture->write(x, y, sums, sky_);
        });
    }
    TileCounters counters() const override { return split_.counters(); }

private:
    static constexpr int kChannels = 5;  // radiance, coverage, depth

    void enterLevels(const PointBlock& block) {
        const View& view = context_.view;
        const SubpixelRect& rect = hits_.rect();
        for (int i = 0; i < block.count; ++i) {
            const int level = levels_.levelOf(block.width[i]);
            if (!block.keep[i] || level == 0) continue;
            const Vec2 p = view.project(Vec3(block.x[i], block.y[i], block.z[i]));
            if (p.x >= float(rect.x0) && p.x < float(rect.x1) && p.y >= float(rect.y0) &&
                p.y < float(rect.y1))
                levels_.add(level, int(p.x), int(p.y), block.z[i]);
        }
        points_since_refresh_ += block.count;
        if (int64_t(points_since_refresh_) * 2 > int64_t(rect.width()) * rect.height()) {
            levels_.refreshHidden();
            points_since_refresh_ = 0;
        }
    }

    // Shades what hit the subpixels that matter, and weighs it.
    void weigh(const SampleLookup& lookup) {
        const int highest = levels_.highest(), reach = 2 << highest;
        // The corner lies on a coarse pixel's.
        const auto from = [&](int v) { return std::max(0, ((v >> highest) << highest) - reach); };
        const SubpixelRect& outer = hits_.rect();
        region_ = {from(inner_.x0), from(inner_.y0), std::min(outer.x1, inner_.x1 + (3 << highest)),
                   std::min(outer.y1, inner_.y1 + (3 << highest))};
        weighted_.reset(region_.width(), region_.height(), kChannels);
        size_t i = 0;
        for (int y = region_.y0; y < region_.y1; ++y) {
            const uint64_t* keys = hits_.row(y);
            for (int x = region_.x0; x < region_.x1; ++x, ++i) {
                const float depth = DepthTile::depthOf(keys[x]);
                float weight = 1.0f - levels_.coverage(x, y, depth);
                if (weight > 0.0f && DepthTile::numberOf(keys[x]) != kNoNumber) {
                    shader_.show(lookup, keys[x], x, y);
                    if (showsBack()) weight = 0.0f;
                    float* values = weighted_.values.data() + i * kChannels;
                    for (int c = 0; c < 3; ++c) values[c] = shader_.radiance()[c];
                    values[3] = 1.0f;
                    values[4] = depth;
                    weighted_.depths[i] = depth;
                }
                weighted_.weights[i] = weight;
            }
        }
    }

    bool showsBack() const {
        const SurfaceSample& sample = shader_.sample();
        if ((*context_.materials)[sample.material].double_sided) return false;
        const Vec3 n = Mat3(context_.view.camera_from_world) * sample.normal_world;
        // Shading normals of what is seen at a grazing angle may well point away.
        constexpr float kGrazing = 0.3f;
        const Vec3& p = sample.position_camera;
        return context_.view.orthographic ? n.z > kGrazing
                                          : glm::dot(n, p) > kGrazing * glm::length(p);
    }

    const ReconstructionContext context_;
    LevelDepths levels_;
    SplitPass split_;
    SkyRow sky_;
    PixelFilter filter_;
    SubpixelShader shader_{context_};
    SurfaceChannels channels_{context_};
    SubpixelRect inner_, region_;  // region_: of weighted_
    DepthTile hits_;
    WeightedImage weighted_;
    ShadedTile shaded_;
    int points_since_refresh_ = 0;
};

}  // namespace

std::unique_ptr<TileReconstruction> makePullPush(const ReconstructionContext& context) {
    return std::make_unique<PullPush>(context);
}

}  // namespace stipple
