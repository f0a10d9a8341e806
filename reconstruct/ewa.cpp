// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/ewa.h>

#include <reconstruct/ellipse.h>
#include <reconstruct/front_slack.h>
#include <reconstruct/per_pixel.h>
#include <reconstruct/pixel_filter.h>
#include <reconstruct/split_pass.h>
#include <reconstruct/surface_channels.h>

namespace stipple {

namespace {

constexpr float kPi = 3.14159265f;
// Discs of the visibility pass have this many times the area that a point stands for.
constexpr float kDiscArea = 6.0f;
// And at least this radius in the picture, so that they reach a subpixel's centre.
constexpr float kLeastRadius = 0.71f;
// Standard deviation of a splat, over the square root of the area that a point stands for.
constexpr float kSplatSigma = 0.5f;
// A patch at least this many discs wide is a surface.
constexpr float kWideInDiscs = 3.0f;
const DiscShape kCircle;  // without cuts
// Points so narrow are of a front no more than a subpixel before them.
constexpr uint8_t kNarrowCode = patchWidthCode(1.0f, kFirstSubpixelExponent);

struct Gathered {
    Vec3 albedo = Vec3(0), normal = Vec3(0);
    float weight = 0.0f;
    float area = 0.0f;  // sum of normalized weights of discs
};

// Radius of a disc seen face on, in subpixels, k points a subpixel.
float discRadius(double k) { return std::sqrt(kDiscArea / (kPi * float(k))); }

std::array<uint8_t, kWidthCodes> wideCodes(double k) {
    return codesFromWidth(kWideInDiscs * std::max(2.0f * discRadius(k), 2.0f));
}

class Ewa : public TileReconstruction {
public:
    explicit Ewa(const ReconstructionContext& context)
        : context_(context),
          split_(context_, wideCodes(context.settings.samples), 1),
          filter_(context.view.subpixels, 0.0f),
          slack_(context.view),
          prefilter_(float(context.settings.ewa_prefilter * context.settings.ewa_prefilter)) {
        const float longest = 1.0f / std::sqrt(Ellipse::kEdgeOn);
        const float radius = discRadius(context.settings.samples);
        disc_reach_ = int(std::ceil(std::hypot(radius * longest, kLeastRadius))) + 1;
        rim_ = int(std::ceil(std::hypot(radius, kLeastRadius)));
        const float sigma = kSplatSigma / std::sqrt(float(context.settings.samples)) * longest;
        splat_reach_ = int(std::ceil(std::sqrt(kKernelEnd * (sigma * sigma + prefilter_)))) + 1;
    }

    int passCount() const override { return 2; }
    int halo() const override {
        // Filling looks two subpixels around.
        return std::max(std::max(disc_reach_, split_.reach(false)) + rim_ + 2, splat_reach_);
    }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        hits_.reset(outer, context_.base, kZBufferBit);
        front_.reset(outer, context_.base, kZBufferBit);
        split_.begin(inner);
        discs_since_refresh_ = 0;
        gathered_.assign(size_t(inner.width()) * size_t(inner.height()), {});
        shader_.forget();
        channels_.forget();
    }

    void beginPass(int pass, const SampleLookup& lookup) override {
        pass_ = pass;
        lookup_ = &lookup;
        if (pass == 0) return;
        for (size_t i = 0; i < front_.keys().size(); ++i)
            front_.keys()[i] = std::min(front_.keys()[i], hits_.keys()[i]);
        if (context_.settings.fill) fillHoles(front_, context_.view, scratch_);
        front_.refreshHidden();
    }

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling) return false;
        const auto grown = [&](int by) {
            return SubpixelRect{rect.x0 - by, rect.y0 - by, rect.x1 + by, rect.y1 + by};
        };
        if (pass_ == 1)
            return front_.hides(grown(narrow ? 0 : splat_reach_), slack_.frontOf(z_min));
        // Hits matter where a rim is given back, as far as nothing within a rim is nearer.
        return hits_.hides(grown(narrow ? 0 : disc_reach_), z_min) ||
               front_.hides(grown((narrow ? 0 : disc_reach_) + rim_), z_min);
    }
    const SubpixelRect& region() const override { return hits_.rect(); }
    bool wantsSurfels() const override { return true; }

    bool take(const PointBlock& block) override {
        if (pass_ == 1) {
            for (int i = 0; i < block.count; ++i) {
                if (block.keep[i]) gather(block, i);
            }
            return false;
        }
        const SplitPass::Taken taken = split_.take(block, hits_, hits_);
        bool is_used = taken.is_used;
        for (int i = 0; taken.wide > 0 && i < block.count; ++i) {
            if (block.keep[i] && split_.isWide(block, i)) is_used |= drawDisc(block, i);
        }
        return is_used;
    }
    bool take(const TriangleBlock& block) override {
        return pass_ == 0 && split_.take(block, hits_);
    }

    void endTile(const SampleLookup& lookup) override {
        shaded_.reset(inner_);
        shader_.forget();
        for (int y = inner_.y0; y < inner_.y1; ++y) {
            for (int x = inner_.x0; x < inner_.x1; ++x) showSubpixel(lookup, x, y);
        }
        filter_.apply(shaded_, inner_, [&](int x, int y, PixelSums& sums) {
            channels_.add(lookup, hits_, x, y, sums);
            split_.addCount(x, y, sums);
            context_.picture->write(x, y, sums, sky_);
        });
    }
    TileCounters counters() const override { return split_.counters(); }

private:
    static Vec3 position(const PointBlock& block, int i) {
        return Vec3(block.x[i], block.y[i], block.z[i]);
    }
    Ellipse ellipseOf(const PointBlock& block, int i) const {
        if (block.shapes) return makeEllipse(context_.view, position(block, i), block.shapes[i]);
        return makeEllipse(context_.view, position(block, i),
                           Vec3(block.normal_x[i], block.normal_y[i], block.normal_z[i]));
    }
    // What a point stands for, m^2: no more than on a plane that is turned to the eye enough to be
    // drawn.
    float areaOf(const PointBlock& block, int i, const Ellipse& e) const {
        if (block.is_prebuilt) return block.area[i];
        const float projected =
            e.unit.determinant() > 0.0f ? std::sqrt(e.unit.determinant()) : 1.0f;
        return std::min(block.area[i], most_projected_ / projected);
    }

    // False if none of it is in front.
    bool drawDisc(const PointBlock& block, int i) {
        bool is_used = false;
        const Ellipse e = ellipseOf(block, i);
        const SubpixelRect& rect = front_.rect();
        const Variance v =
            e.unit.times(areaOf(block, i, e) * (kDiscArea / kPi)).plus(kLeastRadius * kLeastRadius);
        const DiscPlaces disc(context_.view, position(block, i),
                              block.shapes ? block.shapes[i] : kCircle);
        visitEllipse(e.center, v, 1.0f, rect.x0, rect.y0, rect.x1, rect.y1,
                     [&](int x, int y, const Vec2& d, float) {
                         const float depth = planeDepth(context_.view, e, d);
                         if (!(depth < kInfinity) ||
                             !disc.hasSurface(e.center.x + d.x, e.center.y + d.y, depth))
                             return;
                         uint64_t& key = front_.row(y)[x];
                         const uint64_t of_disc = pointKey(block, i, depth);
                         is_used |= of_disc < key;
                         key = std::min(key, of_disc);
                     });
        discs_since_refresh_ += 4;
        if (int64_t(discs_since_refresh_) > int64_t(rect.width()) * rect.height()) {
            front_.refreshHidden();
            discs_since_refresh_ = 0;
        }
        return is_used;
    }

    bool isOnFront(float depth, uint64_t front, uint8_t width_code) const {
        // A triangle is exact, it needs no points.
        return !(DepthTile::numberOf(front) & kAnyTriangle) &&
               slack_.isOnFront(depth, DepthTile::depthOf(front), width_code);
    }
    Gathered& gathered(int x, int y) {
        return gathered_[size_t(y - inner_.y0) * size_t(inner_.width()) + size_t(x - inner_.x0)];
    }

    // Of prebuilt models, whose normals say which side is out.
    bool showsBack(const PointBlock& block, int i) const {
        if (!block.is_prebuilt) return false;
        const Vec3 normal(block.normal_x[i], block.normal_y[i], block.normal_z[i]);
        return (context_.view.orthographic ? normal.z : glm::dot(normal, position(block, i))) >
               0.0f;
    }

    void gather(const PointBlock& block, int i) {
        // Coarse discs are a surface's. What shows its back lies behind a thin part's front, or is
        // the front itself.
        const uint8_t code = showsBack(block, i) ? kNarrowCode
                             : block.is_coarse   ? std::max(block.width[i], kSurfaceCode)
                                                 : block.width[i];
        SurfaceSample sample;
        bool is_looked_up = false;
        // How the normal turns along the half axes of a shape, a metre.
        std::array<Vec3, 2> turn = {Vec3(0), Vec3(0)};
        const auto lookUp = [&](const Vec2& p, float step) {
            sample.depth = block.z[i];
            for (size_t k = 0; block.shapes && k < 2; ++k) {
                sample.position_camera = position(block, i) + block.shapes[i].axis[k] * step;
                lookup_->lookUp(block.number[i], p.x, p.y, sample);
                turn[k] = sample.normal_world / step;
            }
            sample.position_camera = position(block, i);
            lookup_->lookUp(block.number[i], p.x, p.y, sample);
            for (Vec3& t : turn) t -= block.shapes ? sample.normal_world / step : t;
            is_looked_up = true;
        };
        const auto add = [&](int x, int y, const Vec3& normal, float weight, float area) {
            Gathered& sum = gathered(x, y);
            sum.albedo += sample.albedo * weight;
            sum.normal += normal * weight;
            sum.weight += weight;
            sum.area += area;
        };
        if (!split_.isWide(block, i)) {
            const Vec2 p = context_.view.project(position(block, i));
            if (!(p.x >= float(inner_.x0) && p.x < float(inner_.x1) && p.y >= float(inner_.y0) &&
                  p.y < float(inner_.y1)))
                return;
            const int x = int(p.x), y = int(p.y);
            if (!isOnFront(block.z[i], front_.row(y)[x], code)) return;
            lookUp(p, 1.0f);
            add(x, y, sample.normal_world, 1.0f, 0.0f);
            return;
        }
        const Ellipse e = ellipseOf(block, i);
        const float world_area = areaOf(block, i, e);
        const Variance v = e.unit.times(kSplatSigma * kSplatSigma * world_area).plus(prefilter_);
        const float area = world_area * std::sqrt(std::max(e.unit.determinant(), 0.0f));
        const float scale = area / kernelIntegral(v);
        const Variance whole = e.unit.times(world_area * (kDiscArea / kPi));
        const DiscPlaces disc(context_.view, position(block, i),
                              block.shapes ? block.shapes[i] : kCircle);
        visitEllipse(e.center, v, kKernelEnd, inner_.x0, inner_.y0, inner_.x1, inner_.y1,
                     [&](int x, int y, const Vec2& d, float r) {
                         const float depth = planeDepth(context_.view, e, d);
                         if (!(depth < kInfinity) || !isOnFront(depth, front_.row(y)[x], code) ||
                             !disc.hasSurface(e.center.x + d.x, e.center.y + d.y, depth))
                             return;
                         const float w = scale * kernel(r);
                         // Discs with shapes end where the surface does.
                         const bool is_surface = block.shapes && whole.measure(d) < 1.0f;
                         if (!is_looked_up) lookUp(e.center, 0.2f * std::sqrt(world_area));
                         Vec3 normal = sample.normal_world;
                         if (block.shapes) {
                             const Vec2 uv = disc.at(e.center.x + d.x, e.center.y + d.y, depth);
                             normal += turn[0] * uv.x + turn[1] * uv.y;
                         }
                         add(x, y, normal, w, is_surface ? 1.0f : w);
                     });
    }

    // The farthest front within a rim.
    uint64_t farthestAround(int x, int y) const {
        const SubpixelRect& rect = front_.rect();
        uint64_t farthest = 0;
        for (int ny = std::max(rect.y0, y - rim_); ny < std::min(rect.y1, y + rim_ + 1); ++ny) {
            const uint64_t* row = front_.row(ny);
            for (int nx = std::max(rect.x0, x - rim_); nx < std::min(rect.x1, x + rim_ + 1); ++nx)
                farthest = std::max(farthest, row[nx]);
        }
        return farthest;
    }

    // What the subpixel shows, into hits_ and shaded_.
    void showSubpixel(const SampleLookup& lookup, int x, int y) {
        const uint64_t front = front_.row(y)[x];
        uint64_t& shown = hits_.row(y)[x];
        const Gathered& sum = gathered(x, y);
        const float depth = DepthTile::depthOf(front);
        const bool is_rim =
            DepthTile::numberOf(front) != kNoNumber &&
            !slack_.isOnFront(depth, DepthTile::depthOf(shown), uint8_t(kWidthCodes - 1)) &&
            sum.area < 0.5f;
        shown = is_rim ? std::min(shown, farthestAround(x, y)) : front;
        if (DepthTile::numberOf(shown) == kNoNumber) return;
        ShadedSubpixel& out = shaded_.row(y)[x];
        out.covered = 1.0f;
        out.depth = DepthTile::depthOf(shown);
        shader_.show(lookup, shown, x, y);
        out.radiance = shader_.radiance();
        if (!(sum.weight > 0.0f) ||
            (is_rim && !slack_.isOnFront(out.depth, depth, uint8_t(kWidthCodes - 1))))
            return;
        SurfaceSample sample = shader_.sample();
        sample.albedo = sum.albedo / sum.weight;
        const float length = glm::length(sum.normal);
        if (length > 1e-6f * sum.weight) sample.normal_world = sum.normal / length;
        out.radiance = shader_.shadeSample(sample);
    }

    const ReconstructionContext context_;
    SplitPass split_;
    SkyRow sky_;
    PixelFilter filter_;
    const FrontSlack slack_;
    const float prefilter_;  // variance, subpixels squared
    const float most_projected_ = 1.0f / float(context_.settings.samples);  // subpixels a point
    int disc_reach_ = 0, splat_reach_ = 0;
    int rim_ = 0;  // how far a disc reaches beyond an edge
    SubpixelShader shader_{context_};
    SurfaceChannels channels_{context_};
    SubpixelRect inner_;
    DepthTile hits_;   // the nearest point of each subpixel; at the end what it shows
    DepthTile front_;  // the nearest disc
    std::vector<uint64_t> scratch_;
    std::vector<Gathered> gathered_;
    ShadedTile shaded_;
    int discs_since_refresh_ = 0;
    int pass_ = 0;
    const SampleLookup* lookup_ = nullptr;
};

}  // namespace

std::unique_ptr<TileReconstruction> makeEwa(const ReconstructionContext& context) {
    return std::make_unique<Ewa>(context);
}

}  // namespace stipple
