// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/depth_only.h>

#include <reconstruct/depth_pass.h>
#include <reconstruct/per_pixel.h>

namespace stipple {

namespace {

class DepthOnly : public TileReconstruction {
public:
    DepthOnly(const ReconstructionContext& context, const TakeDepths& take_depths)
        : context_(context), take_depths_(take_depths), depth_pass_(context_, 0) {}

    int passCount() const override { return 1; }
    int halo() const override { return 2 + depth_pass_.reach(false); }
    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
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
    // Nobody will ask what a number stands for.
    bool take(const PointBlock& block) override {
        depth_pass_.take(block, tile_);
        return false;
    }
    bool take(const TriangleBlock& block) override {
        depth_pass_.take(block, tile_);
        return false;
    }
    void endTile(const SampleLookup&) override {
        if (context_.settings.fill) fillHoles(tile_, context_.view, scratch_);
        take_depths_(inner_, tile_);
    }
    TileCounters counters() const override { return depth_pass_.counters(); }

private:
    const ReconstructionContext& context_;
    const TakeDepths& take_depths_;
    DepthPass depth_pass_;
    SubpixelRect inner_;
    DepthTile tile_;
    std::vector<uint64_t> scratch_;
};

}  // namespace

std::unique_ptr<TileReconstruction> makeDepthOnly(const ReconstructionContext& context,
                                                  const TakeDepths& take_depths) {
    return std::make_unique<DepthOnly>(context, take_depths);
}

}  // namespace stipple
