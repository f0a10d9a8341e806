// SPDX-License-Identifier: Apache-2.0
#include <render/depth_drawer.h>

#include <core/stopwatch.h>
#include <render/tile_loop.h>

namespace stipple {

namespace {

constexpr int kTileSize = 128;

}  // namespace

void DepthDrawer::draw(const View& view, const RenderSettings& settings,
                       const std::function<bool(const SubpixelRect&)>& is_wanted, bool rasterizes,
                       const TakeDepths& take, FrameStats& drawn) const {
    const FramePlan& plan = sampler.plan(view, settings, pool, request.cancel);
    ReconstructionContext context;
    context.view = view;
    context.settings = settings;
    if (rasterizes) context.base = rasterize(view, plan);
    const TriangleLookup nothing = [](uint32_t, float, float, SurfaceSample&) {};
    TileJob job;
    job.view = view;
    job.tile_size = settings.tile_size;
    job.makeReconstruction = [&] { return makeDepthOnly(context, take); };
    job.is_wanted = is_wanted;
    job.source = &sampler;
    job.batches = &plan.batches;
    job.triangle_lookup = &nothing;
    job.phase = phase;
    runTiles(job, pool, request, drawn);
}

FirstLook takeFirstLook(const View& view, int pixels, const DepthDrawer& drawer,
                        FrameStats& stats) {
    const Stopwatch watch;
    FirstLook look;
    look.view = view;
    look.view.subpixels = 1;
    look.view.width = (view.width + pixels - 1) / pixels;
    look.view.height = (view.height + pixels - 1) / pixels;
    const double scale = 1.0 / (view.subpixels * pixels);
    look.view.focal *= scale;
    look.view.center_x *= scale;
    look.view.center_y *= scale;
    RenderSettings settings = drawer.request.settings;
    settings.subpixels = 1;
    settings.samples = 1.0;
    settings.tile_size = kTileSize;
    const size_t width = size_t(look.view.width);
    look.depth.assign(width * size_t(look.view.height), kInfinity);
    const TakeDepths take = [&](const SubpixelRect& inner, const DepthTile& tile) {
        for (int y = inner.y0; y < inner.y1; ++y) {
            for (int x = inner.x0; x < inner.x1; ++x)
                look.depth[size_t(y) * width + size_t(x)] = DepthTile::depthOf(tile.row(y)[x]);
        }
    };
    FrameStats drawn;
    drawer.draw(look.view, settings, {}, true, take, drawn);
    stats.look_points += drawn.points_drawn;
    stats.phases.emplace_back("look", watch.seconds());
    return look;
}

}  // namespace stipple
