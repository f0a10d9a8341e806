// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_pack.h>

#include <core/image.h>

#include <algorithm>

namespace stipple {

namespace {

Surfel surfelOf(const Splat& splat, float spacing) {
    // Surfels' sides are kDiscSide spacings.
    constexpr float kSharePerRadius = kSidePerRadius / kDiscSide;
    const float long_radius = splat.long_radius + splat.gap,
                short_radius = splat.short_radius + splat.gap;
    Surfel s;
    s.position = splat.center;
    s.normal = splat.normal;
    s.albedo = Vec3(linearFromSrgb(splat.color.x), linearFromSrgb(splat.color.y),
                    linearFromSrgb(splat.color.z));
    s.finish = splat.finish;
    s.radius_share = std::sqrt(long_radius * short_radius) * kSharePerRadius / spacing;
    s.along = splat.along;
    s.ratio = quantizedRatio(long_radius > 0.0f ? short_radius / long_radius : 1.0f);
    s.n_cuts = splat.n_cuts;
    s.shading_normal = splat.shading_normal;
    // Of the half axis that the model will have: radii are rounded up.
    const float kept_radius =
        keptShapeRadius(s.radius_share) * spacing / kSharePerRadius / std::sqrt(s.ratio);
    s.bend = splat.bend * kept_radius;
    for (int i = 0; i < splat.n_cuts; ++i) {
        const Vec3& cut = splat.cuts[size_t(i)];
        s.cuts[size_t(i)] = Vec3(cut.x, cut.y, cut.z / std::max(kept_radius, 1e-30f));
    }
    return s;
}

}  // namespace

SurfelModel packSplats(const std::vector<Splat>& splats, const std::vector<SurfelFinish>& finishes,
                       const DVec3& middle, const Box3& bounds, double area,
                       std::vector<Surfel>* kept) {
    std::vector<float> sides;
    for (const Splat& s : splats) {
        sides.push_back(std::sqrt((s.long_radius + s.gap) * (s.short_radius + s.gap)) *
                        kSidePerRadius / kDiscSide);
    }
    const auto median = sides.begin() + std::ptrdiff_t(sides.size() / 2);
    std::nth_element(sides.begin(), median, sides.end());
    const float spacing = std::max(*median, 1e-20f);
    std::vector<Surfel> surfels;
    for (const Splat& s : splats) surfels.push_back(surfelOf(s, spacing));
    SurfelModel model;
    model.kind = "splats";
    model.bounds = bounds;
    model.area = area;
    model.finishes = finishes;
    std::vector<uint32_t> place_in_level;
    SurfelLevel level =
        packSurfels(std::move(surfels), finishes, spacing, SurfelDiscs::kShapes, &place_in_level);
    for (SurfelBlock& block : level.blocks) {
        block.bounds.min += Vec3(middle);
        block.bounds.max += Vec3(middle);
        block.cone_apex += Vec3(middle);
    }
    if (kept) {
        std::vector<Surfel> in_level;
        for (const SurfelBlock& block : level.blocks) {
            for (uint32_t i = block.first; i < block.first + block.count; ++i) {
                in_level.push_back(unpackSurfel(level, block, i));
                in_level.back().position = Vec3(DVec3(in_level.back().position) - middle);
            }
        }
        kept->clear();
        for (const uint32_t place : place_in_level) kept->push_back(in_level[place]);
    }
    model.levels.push_back(std::move(level));
    return model;
}

}  // namespace stipple
