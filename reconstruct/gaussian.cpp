// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/gaussian.h>

#include <reconstruct/depth_pass.h>
#include <reconstruct/per_pixel.h>
#include <reconstruct/shade.h>

namespace stipple {

namespace {

// Weighted sums of one pixel.
struct Weighted {
    Vec3 radiance = Vec3(0), normal = Vec3(0), albedo = Vec3(0);
    float weight = 0.0f;
};

class Gaussian : public TileReconstruction {
public:
    explicit Gaussian(const ReconstructionContext& context)
        : context_(context),
          depth_pass_(context_, 0),
          sigma_(std::max(0.05f, 0.5f * float(context.settings.splat_size))),
          radius_(kCut * sigma_),
          // A surface seen at 80 degrees gains 6 subpixels of depth for each subpixel sideways.
          slack_(std::max(0.01f,
                          context.view.orthographic ? 0.0f : 12.0f / float(context.view.focal))),
          slack_metres_(context.view.orthographic ? 12.0f / float(context.view.focal) : 0.0f) {}

    int passCount() const override { return 2; }
    int halo() const override {
        return int(std::ceil(radius_ * float(context_.view.subpixels))) + 2;
    }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        tile_.reset(outer, context_.base, kZBufferBit);
        depth_pass_.begin(inner);
        const int s = context_.view.subpixels;
        width_ = inner.width() / s;
        height_ = inner.height() / s;
        sums_.assign(size_t(width_) * size_t(height_), {});
    }

    void beginPass(int pass, const SampleLookup& lookup) override {
        pass_ = pass;
        lookup_ = &lookup;
        if (pass == 0) return;
        if (context_.settings.fill) fillHoles(tile_, scratch_);
        tile_.refreshHidden();
        takeTriangles();
    }

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling) return false;
        const int reach = depth_pass_.reach(narrow);
        return tile_.hides({rect.x0 - reach, rect.y0 - reach, rect.x1 + reach, rect.y1 + reach},
                           (z_min - slack_metres_) / (1.0f + slack_));
    }
    const SubpixelRect& region() const override { return tile_.rect(); }

    bool take(const PointBlock& block) override {
        if (pass_ == 0) return depth_pass_.take(block, tile_);
        average(block);
        return false;
    }
    bool take(const TriangleBlock& block) override {
        return pass_ == 0 && depth_pass_.take(block, tile_);
    }

    void endTile(const SampleLookup& lookup) override {
        const int s = context_.view.subpixels;
        for (int py = 0; py < height_; ++py) {
            for (int px = 0; px < width_; ++px) writePixel(lookup, px, py, s);
        }
    }
    TileCounters counters() const override { return depth_pass_.counters(); }

private:
    static constexpr float kCut = 2.5f;  // the Gaussian ends at this many sigmas

    void average(const PointBlock& block) {
        const View& view = context_.view;
        const SubpixelRect& rect = tile_.rect();
        for (int i = 0; i < block.count; ++i) {
            if (!block.keep[i]) continue;
            const Vec2 p = view.project(Vec3(block.x[i], block.y[i], block.z[i]));
            if (!(p.x >= float(rect.x0) && p.x < float(rect.x1) && p.y >= float(rect.y0) &&
                  p.y < float(rect.y1)))
                continue;
            const uint64_t front = tile_.row(int(p.y))[int(p.x)];
            if (block.z[i] > DepthTile::depthOf(front) * (1.0f + slack_) + slack_metres_) continue;
            SurfaceSample sample;
            sample.depth = block.z[i];
            sample.position_camera = Vec3(block.x[i], block.y[i], block.z[i]);
            lookup_->lookUp(block.number[i], p.x, p.y, sample);
            spread(sample, p, 1.0f);
        }
    }

    // Every subpixel in which a triangle is in front counts as the points it would have had.
    void takeTriangles() {
        const SubpixelRect& rect = tile_.rect();
        for (int y = rect.y0; y < rect.y1; ++y) {
            for (int x = rect.x0; x < rect.x1; ++x) {
                const uint64_t key = tile_.row(y)[x];
                const uint32_t number = DepthTile::numberOf(key);
                if (number == kNoNumber || !(number & kAnyTriangle)) continue;
                const Vec2 p(float(x) + 0.5f, float(y) + 0.5f);
                SurfaceSample sample;
                sample.depth = DepthTile::depthOf(key);
                Vec3 origin, direction;
                context_.view.ray(p.x, p.y, origin, direction);
                sample.position_camera = origin + direction * sample.depth;
                lookup_->lookUp(number, p.x, p.y, sample);
                spread(sample, p, float(context_.settings.samples));
            }
        }
    }

    void spread(const SurfaceSample& sample, const Vec2& p_sub, float weight) {
        const Vec3 shaded = shade(sample, (*context_.materials)[sample.material],
                                  *context_.lighting, context_.view);
        const float to_pixels = 1.0f / float(context_.view.subpixels);
        const float x = (p_sub.x - float(inner_.x0)) * to_pixels - 0.5f,
                    y = (p_sub.y - float(inner_.y0)) * to_pixels - 0.5f;
        const int x0 = std::max(0, int(std::ceil(x - radius_))),
                  x1 = std::min(width_ - 1, int(std::floor(x + radius_)));
        const int y0 = std::max(0, int(std::ceil(y - radius_))),
                  y1 = std::min(height_ - 1, int(std::floor(y + radius_)));
        const float scale = -0.5f / (sigma_ * sigma_);
        for (int py = y0; py <= y1; ++py) {
            for (int px = x0; px <= x1; ++px) {
                const float dx = float(px) - x, dy = float(py) - y;
                const float w = weight * std::exp(scale * (dx * dx + dy * dy));
                Weighted& sum = sums_[size_t(py) * size_t(width_) + size_t(px)];
                sum.radiance += shaded * w;
                sum.normal += sample.normal_world * w;
                sum.albedo += sample.albedo * w;
                sum.weight += w;
            }
        }
    }

    // Colour from the weighted sums; coverage and depth from the pixel's subpixels.
    void writePixel(const SampleLookup& lookup, int px, int py, int s) {
        PixelSums sums;
        const int x0 = inner_.x0 + px * s, y0 = inner_.y0 + py * s;
        uint64_t nearest = DepthTile::kEmpty;
        for (int y = y0; y < y0 + s; ++y) {
            for (int x = x0; x < x0 + s; ++x) {
                const uint64_t key = tile_.row(y)[x];
                sums.samples += 1.0f;
                if (DepthTile::numberOf(key) == kNoNumber) continue;
                nearest = std::min(nearest, key);
                sums.covered += 1.0f;
                sums.depth += DepthTile::depthOf(key);
                sums.depth_max = std::max(sums.depth_max, DepthTile::depthOf(key));
            }
        }
        const Weighted& sum = sums_[size_t(py) * size_t(width_) + size_t(px)];
        if (sums.covered > 0.0f) {
            SurfaceSample sample;
            sample.depth = DepthTile::depthOf(nearest);
            const float cx = float(x0) + 0.5f * float(s), cy = float(y0) + 0.5f * float(s);
            lookup.lookUp(DepthTile::numberOf(nearest), cx, cy, sample);
            sums.object = sample.object;
            Weighted mean = sum;
            if (!(sum.weight > 0.0f)) {  // no point near enough to the pixel's centre
                Vec3 origin, direction;
                context_.view.ray(cx, cy, origin, direction);
                sample.position_camera = origin + direction * sample.depth;
                mean = {shade(sample, (*context_.materials)[sample.material], *context_.lighting,
                              context_.view),
                        sample.normal_world, sample.albedo, 1.0f};
            }
            const float per_weight = sums.covered / mean.weight;
            sums.radiance = mean.radiance * per_weight;
            sums.normal = mean.normal * per_weight;
            sums.albedo = mean.albedo * per_weight;
        }
        const size_t index = size_t(py) * size_t(width_) + size_t(px);
        if (!depth_pass_.counts().empty()) sums.points = depth_pass_.counts()[index];
        context_.picture->write(inner_.x0 / s + px, inner_.y0 / s + py, sums);
    }

    const ReconstructionContext context_;
    DepthPass depth_pass_;
    const float sigma_, radius_;  // pixels
    const float slack_, slack_metres_;
    SubpixelRect inner_;
    DepthTile tile_;
    std::vector<uint64_t> scratch_;
    int pass_ = 0;
    const SampleLookup* lookup_ = nullptr;
    int width_ = 0, height_ = 0;
    std::vector<Weighted> sums_;
};

}  // namespace

std::unique_ptr<TileReconstruction> makeGaussian(const ReconstructionContext& context) {
    return std::make_unique<Gaussian>(context);
}

}  // namespace stipple
