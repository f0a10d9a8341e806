// SPDX-License-Identifier: Apache-2.0
#include <tools/block_study_views.h>

#include <core/rng.h>
#include <render/compare.h>
#include <render/renderer.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr uint64_t kSeed = 1998;
constexpr double kEyeDistance = 4.0;         // from what is looked at, in radii
constexpr double kMagnification = 4.0;       // of kMagnified
constexpr double kWideDistance = 2.0;        // from the middle, in radii: unit magnification
constexpr double kWideFov = 0.5 * kPi;       // radians
constexpr double kWideAside = kPi * 0.1944;  // from the optical axis to the middle: 35 degrees

int viewCount(BlockViews kind) {
    return kind == BlockViews::kUnit ? 200 : kind == BlockViews::kMagnified ? 20 : 8;
}

DVec3 randomDirection(Rng& rng) {
    const double y = rng.uniform(-1.0, 1.0), phi = rng.uniform(0.0, 2.0 * kPi);
    const double r = std::sqrt(1.0 - y * y);
    return {r * std::cos(phi), y, r * std::sin(phi)};
}

// Somewhere on the surface.
DVec3 randomPoint(const SurfelModel& model, Rng& rng) {
    const SurfelLevel& level = model.levels[0];
    const SurfelBlock& block = level.blocks[size_t(rng.uniform() * double(level.blocks.size()))];
    return DVec3(unpackSurfel(level, block, block.first).position);
}

Camera randomCamera(const SurfelModel& model, BlockViews kind, int resolution, Rng& rng) {
    const Box3& bounds = model.bounds;
    const DVec3 center(bounds.center());
    const double radius = 0.5 * glm::length(bounds.extent());
    const DVec3 from = randomDirection(rng);
    Camera camera;
    if (kind == BlockViews::kWide) {
        // Turned away, to any side.
        const DVec3 eye = center + from * radius * kWideDistance;
        const DVec3 side = glm::normalize(glm::cross(from, randomDirection(rng)));
        camera = lookAt(eye, eye - from * std::cos(kWideAside) + side * std::sin(kWideAside));
        camera.fov_y = kWideFov;
    } else {
        const bool is_magnified = kind == BlockViews::kMagnified;
        const DVec3 target = is_magnified ? randomPoint(model, rng) : center;
        camera = lookAt(target + from * radius * kEyeDistance, target);
        const double pixel = 2.0 * radius / resolution / (is_magnified ? kMagnification : 1.0);
        // The near side of what is magnified is the target.
        const double depth = (kEyeDistance - (is_magnified ? 0.0 : 1.0)) * radius;
        camera.fov_y = 2.0 * std::atan(0.5 * resolution * pixel / depth);
    }
    camera.near_z = 0.01 * radius;
    return camera;
}

}  // namespace

BlockViewsResult measureBlockViews(const Scene& source, const Scene& shown,
                                   const SurfelModel& model, BlockViews kind, int resolution,
                                   ThreadPool& pool, const CancelFlag* cancel,
                                   const std::function<void()>& before_view) {
    Renderer by_rays(source, pool), by_points(shown, pool);
    FrameRequest points;
    points.settings.width = points.settings.height = resolution;
    points.settings.subpixels = 1;
    points.aovs = {"depth", "coverage"};
    points.cancel = cancel;
    FrameRequest rays = points;
    rays.settings.method = Method::kRaycast;

    Rng rng{kSeed};
    BlockViewsResult result;
    result.views = viewCount(kind);
    for (int v = 0; v < result.views; ++v) {
        before_view();
        points.camera = rays.camera = randomCamera(model, kind, resolution, rng);
        const Image drawn = by_points.render(points).image;
        rays.settings.samples = 1;
        const double psnr = compareImages(drawn, by_rays.render(rays).image, pool).psnr;
        rays.settings.samples = 16;
        const double holes =
            double(compareImages(drawn, by_rays.render(rays).image, pool).holes->count);
        result.holes += holes;
        result.views_with_holes += holes > 0.0;
        result.most_holes = std::max(result.most_holes, holes);
        result.mean_psnr += psnr / result.views;
        result.worst_psnr = std::min(result.worst_psnr, psnr);
    }
    return result;
}

}  // namespace stipple
