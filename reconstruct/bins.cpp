// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/bins.h>

#include <core/rng.h>
#include <reconstruct/blended_triangles.h>
#include <reconstruct/ellipse.h>
#include <reconstruct/front_means.h>
#include <reconstruct/layer_bins.h>
#include <reconstruct/surface_channels.h>

namespace stipple {

namespace {

SubpixelRect grown(const SubpixelRect& rect, int by) {
    return {rect.x0 - by, rect.y0 - by, rect.x1 + by, rect.y1 + by};
}
SubpixelRect common(const SubpixelRect& a, const SubpixelRect& b) {
    return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

bool hasBlended(const std::vector<Material>* materials) {
    return materials && std::any_of(materials->begin(), materials->end(), [](const Material& m) {
               return m.alpha_mode == AlphaMode::kBlend;
           });
}

class Bins : public TileReconstruction {
public:
    explicit Bins(const ReconstructionContext& context)
        : context_(context),
          means_(context_),
          filter_(context.view.subpixels, 0.0f),
          footprints_(float(context.settings.samples)),
          layers_(context.view, context.settings.samples),
          has_layers_(hasBlended(context.materials)),
          reach_(has_layers_ ? layers_.reach() * context.view.subpixels : 0) {}

    int passCount() const override { return 2; }
    // A pixel's layers go on in those around, and what is in front of these tells which points
    // they need.
    int halo() const override { return means_.halo() + 2 * reach_; }

    void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) override {
        inner_ = inner;
        means_.beginTile(inner, inner, outer);
        channels_.forget();
        shader_.forget();
        binned_ = common(grown(inner, reach_), outer);
        wanted_ = has_layers_ ? common(grown(binned_, 1), outer) : inner;
        if (has_layers_) layers_.reset(binned_);
    }
    void beginPass(int pass, const SampleLookup& lookup) override {
        pass_ = pass;
        lookup_ = &lookup;
        means_.beginPass(pass, lookup);
        if (pass == 1 && has_layers_)
            layers_.setFronts(means_.fronts(), common(grown(binned_, reach_), outer()));
    }

    bool hides(const SubpixelRect& rect, float z_min, bool narrow) override {
        if (!context_.settings.culling || !means_.hides(rect, z_min, narrow)) return false;
        // Layers are needed where anything behind them is seen as far around as they are closed.
        return pass_ == 0 || !has_layers_ ||
               means_.fronts().hides(grown(rect, reach_ + context_.view.subpixels), z_min);
    }
    const SubpixelRect& region() const override { return pass_ == 0 ? outer() : wanted_; }
    bool wantsLayers() const override { return true; }

    bool take(const PointBlock& block) override {
        const bool is_used = means_.take(block);
        for (int i = 0; pass_ == 1 && i < block.count; ++i) {
            if (block.keep[i] == kBlended) addPoint(block, i);
        }
        return is_used;
    }
    bool take(const TriangleBlock& block) override {
        if (pass_ == 1 && block.blended) addTriangles(block);
        return !block.is_clear && means_.take(block);
    }

    void endTile(const SampleLookup& lookup) override {
        ShadedTile& shaded = means_.finish(lookup);
        if (has_layers_) layers_.composite(means_.fronts(), inner_, shaded);
        filter_.apply(shaded, inner_, [&](int x, int y, PixelSums& sums) {
            channels_.add(lookup, means_.fronts(), x, y, sums);
            means_.split().addCount(x, y, sums);
            context_.picture->write(x, y, sums, sky_);
        });
    }
    TileCounters counters() const override { return means_.split().counters(); }

private:
    const SubpixelRect& outer() const { return means_.fronts().rect(); }

    void addPoint(const PointBlock& block, int i) {
        const View& view = context_.view;
        const Vec3 p_camera(block.x[i], block.y[i], block.z[i]);
        const Vec2 p = view.project(p_camera);
        if (!(p.x >= float(wanted_.x0) && p.x < float(wanted_.x1) && p.y >= float(wanted_.y0) &&
              p.y < float(wanted_.y1)))
            return;
        const uint8_t code = block.width[i];
        const bool is_wide = means_.split().isWide(block, i);
        int x0 = int(p.x), y0 = int(p.y), side = 1;
        if (!is_wide) {
            // As DepthPass has it.
            const float half_side = footprints_.half_side[code];
            const uint32_t bits = mixBits32(std::bit_cast<uint32_t>(block.x[i]) * 0x9e3779b9u ^
                                            std::bit_cast<uint32_t>(block.y[i]));
            if (float(int(bits >> 8)) * 0x1p-24f < footprints_.wide_share[code]) {
                x0 = int(std::floor(p.x - 0.5f)), y0 = int(std::floor(p.y - 0.5f)), side = 2;
            } else if (!(std::abs(p.x - float(x0) - 0.5f) <= half_side &&
                         std::abs(p.y - float(y0) - 0.5f) <= half_side)) {
                return;
            }
        }
        const Vec3 normal(block.normal_x[i], block.normal_y[i], block.normal_z[i]);
        const Ellipse e = makeEllipse(view, p_camera, normal);
        Contribution c;
        c.at = p;
        c.q = e.q, c.slope = e.slope;
        c.depth = block.z[i];
        c.faces_eye = glm::dot(normal, view.orthographic ? Vec3(0, 0, 1) : p_camera) < 0.0f;
        c.is_closed = is_wide;
        bool is_known = false;
        for (int y = std::max(y0, binned_.y0); y < std::min(y0 + side, binned_.y1); ++y) {
            for (int x = std::max(x0, binned_.x0); x < std::min(x0 + side, binned_.x1); ++x) {
                if (is_wide ? layers_.hides(x, y, c.depth) : isBehindFront(x, y, c.depth)) continue;
                if (!is_known) lookUp(p_camera, block.number[i], p, c);
                is_known = true;
                layers_.add(x, y, c);
            }
        }
    }

    bool isBehindFront(int x, int y, float depth) const {
        return depth > DepthTile::depthOf(means_.fronts().row(y)[x]);
    }
    // Alpha and radiance.
    void lookUp(const Vec3& p_camera, uint32_t number, const Vec2& p_sub, Contribution& c) {
        shader_.lookUp(*lookup_, p_camera, number, p_sub);
        c.alpha = std::clamp(shader_.sample().alpha, 0.0f, 1.0f);
        c.radiance = c.alpha > 0.0f ? shader_.shadeSample(shader_.sample()) : Vec3(0);
    }

    void addTriangles(const TriangleBlock& block) {
        const View& view = context_.view;
        for (int i = 0; i < block.count; ++i) {
            if (!(block.blended >> i & 1)) continue;
            const BlendedTriangle triangle(view, block, i);
            const SubpixelRect bounds = triangle.bounds(binned_);
            if (bounds.x0 >= bounds.x1 || bounds.y0 >= bounds.y1 ||
                means_.fronts().hides(bounds, triangle.nearest()))
                continue;
            Contribution c;
            c.q = triangle.plane().q, c.slope = triangle.plane().slope;
            c.at = triangle.plane().at;
            c.faces_eye = triangle.facesEye();
            c.is_closed = block.is_wide;
            c.is_triangle = true;
            const auto isSeen = [&](int x, int y, float depth) {
                return !isBehindFront(x, y, depth);
            };
            const auto cover = [&](int x, int y, float depth) {
                // Triangles are exact, nothing is closed beyond them. Most texels of a leaf's
                // picture show nothing, and where it is opaque the first pass has drawn it.
                const float alpha =
                    block.mask ? block.mask->alpha(i, float(x) + 0.5f, float(y) + 0.5f) : 1.0f;
                if (alpha > 0.0f && (!block.mask || alpha < kOpaqueAlpha))
                    covered_.push_back({x, y, depth, alpha});
            };
            triangle.visit(bounds, shader_.sharedSide(), isSeen, cover, [&] {
                if (!covered_.empty())
                    addCovered(triangle.plane(), block.first_number + uint32_t(i), c);
                covered_.clear();
            });
        }
    }

    // Subpixels of one triangle, which are shaded together if they may be.
    void addCovered(const PicturePlane& plane, uint32_t number, Contribution& c) {
        const bool is_shared = covered_.size() > 1 && showMiddle(plane, number);
        for (const Covered& at : covered_) {
            if (!is_shared) {
                const Vec2 middle(float(at.x) + 0.5f, float(at.y) + 0.5f);
                shader_.showPoint(*lookup_, positionAt(middle, at.depth), number, middle);
            }
            c.depth = at.depth;
            c.alpha = at.alpha;
            c.radiance = shader_.radiance();
            layers_.add(at.x, at.y, c);
        }
    }
    bool showMiddle(const PicturePlane& plane, uint32_t number) {
        Vec2 middle(0.0f);
        for (const Covered& at : covered_) middle += Vec2(float(at.x) + 0.5f, float(at.y) + 0.5f);
        middle /= float(covered_.size());
        const float q = plane.qAt(middle);
        return shader_.showShared(*lookup_,
                                  positionAt(middle, context_.view.orthographic ? q : 1.0f / q),
                                  number, middle, float(covered_.size()));
    }
    Vec3 positionAt(const Vec2& p_sub, float depth) const {
        Vec3 origin, direction;
        context_.view.ray(p_sub.x, p_sub.y, origin, direction);
        return origin + direction * depth;
    }

    const ReconstructionContext context_;
    FrontMeans means_;
    SkyRow sky_;
    PixelFilter filter_;
    const FootprintTable footprints_;
    LayerBins layers_;
    const bool has_layers_;
    const int reach_;  // how far around a pixel its layers go on, subpixels
    SubpixelShader shader_{context_};
    SurfaceChannels channels_{context_};
    SubpixelRect inner_;
    SubpixelRect binned_;  // whole pixels
    SubpixelRect wanted_;  // by the second pass
    struct Covered {
        int x, y;
        float depth, alpha;
    };
    std::vector<Covered> covered_;  // by the triangle at hand, of a square
    int pass_ = 0;
    const SampleLookup* lookup_ = nullptr;
};

}  // namespace

std::unique_ptr<TileReconstruction> makeBins(const ReconstructionContext& context) {
    return std::make_unique<Bins>(context);
}

}  // namespace stipple
