// SPDX-License-Identifier: Apache-2.0
#include <sampling/random_sampler.h>

#include <sampling/tile_cut.h>
#include <sampling/triangle_writer.h>

#include <algorithm>

namespace stipple {

const FramePlan& RandomizedSampler::plan(const View& view, const RenderSettings& settings,
                                         ThreadPool& pool, const CancelFlag* cancel) {
    view_ = view;
    settings_ = settings;
    lists_.startFrame({settings.seed, settings.sampler, drawsLayers(settings)},
                      size_t(settings.cache_mb) << 20, pool);
    plan_ = planFrame(scene_, view, settings, false, pool, cancel);
    return plan_;
}

std::unique_ptr<TileEmitter> RandomizedSampler::makeEmitter() {
    return std::make_unique<TileCut>(scene_, view_, settings_, plan_, lists_);
}

void rasterAttributes(const Scene& scene, const View& view, const FramePlan& plan, uint32_t number,
                      float sub_x, float sub_y, SurfaceSample& sample) {
    // The draw whose numbers hold it: numbers of a draw begin at first_number + its lowest
    // triangle.
    const auto begin = plan.raster.draws.begin();
    const auto firstOf = [&](const RasterDraw& d) {
        return d.first_number + plan.raster.ranges[d.range_begin].first;
    };
    const auto found =
        std::upper_bound(begin, plan.raster.draws.end(), number,
                         [&](uint32_t n, const RasterDraw& d) { return n < firstOf(d); });
    const size_t draw = size_t(found - begin) - 1;
    const RasterInstance& instance = plan.raster_instances[draw];
    triangleAttributes(scene, view, instance.frame, instance.mesh,
                       number - plan.raster.draws[draw].first_number, sub_x, sub_y, sample);
}

}  // namespace stipple
