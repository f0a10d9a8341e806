// SPDX-License-Identifier: Apache-2.0
#include <render/renderer.h>

#include <core/stopwatch.h>
#include <raster/rasterizer.h>
#include <raycast/embree_raycaster.h>
#include <render/raycast_method.h>
#include <render/screen_occlusion.h>
#include <render/shadow_maps.h>
#include <render/tile_loop.h>
#include <sampling/random_sampler.h>

#include <cstdio>

namespace stipple {

namespace {

std::vector<RasterMesh> rasterMeshes(const Scene& scene) {
    std::vector<RasterMesh> meshes;
    for (const Mesh& m : scene.meshes) {
        meshes.push_back({&m.positions, &m.uvs, &m.colors, &m.triangles, &m.triangle_material});
    }
    return meshes;
}

std::vector<CutBox> cutBoxes(const Scene& scene, const FramePlan& plan) {
    std::vector<CutBox> boxes;
    for (const PlannedNode& node : plan.nodes) {
        const Box3 bounds = nodeBounds(scene, node.child, node.node);
        CutBox box;
        for (int i = 0; i < 8; ++i) {
            DVec3 p;
            for (int axis = 0; axis < 3; ++axis)
                p[axis] = double((i >> axis & 1) ? bounds.max[axis] : bounds.min[axis]);
            box.corners[size_t(i)] = Vec3(node.camera_from_child.point(p));
        }
        boxes.push_back(box);
    }
    return boxes;
}

// Pixels along a side of one of the first look's: pages of shadows are found by a coarse one.
constexpr int kShadowLookPixels = 4, kOcclusionLookPixels = 1;

struct Visibility {
    std::unique_ptr<LightVisibility> lights;     // null: nothing casts shadows
    std::unique_ptr<AmbientVisibility> ambient;  // null: all is open
};

}  // namespace

struct Renderer::Impl {
    const Scene& scene;
    ThreadPool& pool;
    RandomizedSampler sampler;
    ShadowCache shadow_cache;
    std::unique_ptr<Rasterizer> rasterizer;  // started when first needed
    RasterTarget target;
    std::unique_ptr<RayCaster> caster;  // built when first needed, for caster_origin
    DVec3 caster_origin = DVec3(0.0);

    Impl(const Scene& s, ThreadPool& p) : scene(s), pool(p), sampler(s) {}

    // Rasterizes what the plan leaves to the z-buffer into `target`.
    const RasterTarget* rasterizePlan(const View& view, const FramePlan& plan) {
        if (plan.raster.draws.empty()) return nullptr;
        if (!rasterizer) {
            rasterizer = makeOsmesaRasterizer(rasterMeshes(scene), scene.materials, scene.textures,
                                              pool.threadCount());
        }
        rasterizer->render(view, plan.raster, target);
        return &target;
    }

    // What shading must know of what lies elsewhere, if asked for. Before the frame's own plan: the
    // sampler has one at a time.
    Visibility makeVisibility(const FrameRequest& request, const View& view, FrameStats& stats) {
        Visibility visibility;
        const bool has_shadows = request.settings.shadows &&
                                 (!scene.lighting.suns.empty() || !lampsOf(scene.lighting).empty());
        if (!has_shadows && !request.settings.ao) return visibility;
        const RasterizeLarge rasterize = [&](const View& v, const FramePlan& plan) {
            return rasterizePlan(v, plan);
        };
        DepthDrawer drawer = {sampler, rasterize, pool, request, "look"};
        if (request.progress) request.progress("look", 0.0);
        FirstLook look = takeFirstLook(
            view, request.settings.ao ? kOcclusionLookPixels : kShadowLookPixels, drawer, stats);
        if (has_shadows) {
            drawer.phase = "shadows";
            if (request.progress) request.progress("shadows", 0.0);
            visibility.lights = makeShadowMaps(scene, view, look, drawer, shadow_cache, stats);
        }
        if (request.settings.ao) {
            visibility.ambient = std::make_unique<ScreenOcclusion>(view, std::move(look),
                                                                   request.settings.ao_radius);
        }
        return visibility;
    }

    // From the plan to the picture: large triangles to the z-buffer, points to the tiles, both into
    // one depth test.
    void drawPlan(const FrameRequest& request, const View& view, const FramePlan& plan,
                  PointSource* source, const Visibility& visibility, Picture& picture,
                  FrameStats& stats) {
        ReconstructionContext context;
        context.view = view;
        context.settings = request.settings;
        context.settings.tile_size = tileSide(view, request.settings.tile_size);
        context.materials = &scene.materials;
        context.lighting = &scene.lighting;
        context.light_visibility = visibility.lights.get();
        context.ambient_visibility = visibility.ambient.get();
        context.picture = &picture;
        const Stopwatch raster_watch;
        context.base = rasterizePlan(view, plan);
        stats.phases.emplace_back("raster", raster_watch.seconds());
        stats.large_triangles = plan.raster_triangles;
        const TriangleLookup triangle_lookup = [&](uint32_t number, float x, float y,
                                                   SurfaceSample& sample) {
            rasterAttributes(scene, view, plan, number, x, y, sample);
        };
        drawTiles(context, source, plan.batches, triangle_lookup, pool, request, stats);
        stats.overestimation =
            stats.points_kept ? double(stats.points_drawn) / double(stats.points_kept) : 0.0;
    }

    void drawPoints(const FrameRequest& request, const View& view, Picture& picture, Frame& frame) {
        FrameStats& stats = frame.stats;
        const Visibility visibility = makeVisibility(request, view, stats);
        if (request.progress) request.progress("plan", 0.0);
        const Stopwatch plan_watch;
        const FramePlan& plan = sampler.plan(view, request.settings, pool, request.cancel);
        stats.phases.emplace_back("plan", plan_watch.seconds());
        if (request.wants_cut) frame.cut = cutBoxes(scene, plan);
        drawPlan(request, view, plan, &sampler, visibility, picture, stats);
        stats.cache_bytes = sampler.cacheBytes();
    }

    void drawZBuffer(const FrameRequest& request, const View& view, Picture& picture,
                     FrameStats& stats) {
        const double triangles = sceneSize(scene).triangles_total;
        if (triangles > kZBufferLimit) {
            char message[160];
            std::snprintf(message, sizeof message,
                          "--method zbuffer draws every triangle and is refused above 10^9 (this "
                          "scene has %.3g)",
                          triangles);
            throw Error(ErrorCode::kInvalidArgument, "", message);
        }
        const Visibility visibility = makeVisibility(request, view, stats);
        const Stopwatch plan_watch;
        const FramePlan plan = planFrame(scene, view, request.settings, true, pool, request.cancel);
        stats.phases.emplace_back("plan", plan_watch.seconds());
        drawPlan(request, view, plan, nullptr, visibility, picture, stats);
    }

    void drawRaycast(const FrameRequest& request, const View& view, Picture& picture,
                     FrameStats& stats) {
        if (!caster || caster_origin != view.eye_world) {
            if (request.progress) request.progress("build", 0.0);
            const Stopwatch build_watch;
            caster.reset();
            caster = makeEmbreeRayCaster(scene, view.eye_world, pool.threadCount());
            caster_origin = view.eye_world;
            stats.phases.emplace_back("build", build_watch.seconds());
        }
        drawRays(*caster, view, scene.materials, scene.lighting, pool, request, picture, stats);
    }
};

Renderer::Renderer(const Scene& scene, ThreadPool& pool)
    : impl_(std::make_unique<Impl>(scene, pool)) {}
Renderer::~Renderer() = default;

void Renderer::sceneChanged(const SceneChanges& changes) {
    if (!changes.any) return;
    impl_->sampler.sceneChanged(changes);
    impl_->shadow_cache.sceneChanged(changes);
    impl_->caster.reset();
    if (changes.assets) impl_->rasterizer.reset();
}

Frame Renderer::render(const FrameRequest& asked) {
    Frame frame;
    FrameRequest request = asked;
    request.settings = drawnSettings(asked.settings);
    const View view = makeView(request.camera, request.settings.width, request.settings.height,
                               request.settings.subpixels);
    const Stopwatch watch;
    Lighting lighting = impl_->scene.lighting;
    lighting.exposure += float(request.settings.exposure);
    Picture picture(view, lighting, request.aovs, request.transparent);
    int debug_x = 0, debug_y = 0;
    const bool is_debugging =
        std::sscanf(request.debug_pixel.c_str(), "%d,%d", &debug_x, &debug_y) == 2 &&
        debug_x >= 0 && debug_y >= 0 && debug_x < view.width && debug_y < view.height;
    if (is_debugging) picture.watch(debug_x, debug_y);
    switch (request.settings.method) {
        case Method::kPoints:
            impl_->drawPoints(request, view, picture, frame);
            break;
        case Method::kZBuffer:
            impl_->drawZBuffer(request, view, picture, frame.stats);
            break;
        case Method::kRaycast:
            impl_->drawRaycast(request, view, picture, frame.stats);
            break;
    }
    frame.stats.seconds = watch.seconds();
    for (const auto& [name, seconds] : frame.stats.phases) {
        if (name == "build") frame.stats.seconds -= seconds;
    }
    if (is_debugging) frame.stats.debug_text = picture.watchedPixel();
    frame.image = std::move(picture.image());
    return frame;
}

}  // namespace stipple
