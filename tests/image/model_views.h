// SPDX-License-Identifier: Apache-2.0
// Square pictures of models, from any direction, for the tests of prebuilt models.
#pragma once

#include <render/renderer.h>

#include <cmath>

namespace stipple {

// From a direction, the bounds' diagonal `size` pixels long.
inline Camera cameraTo(const Scene& scene, const Vec3& from, double size, int pixels) {
    const DBox3 bounds = sceneBounds(scene);
    const DVec3 center = 0.5 * (bounds.min + bounds.max);
    const double diagonal = glm::length(bounds.max - bounds.min);
    Camera camera = lookAt(center + DVec3(from) * diagonal * 3.0, center);
    camera.fov_y = 2.0 * std::atan(0.5 * pixels / size / 3.0);
    return camera;
}

// With depth and coverage, as finding holes needs them.
inline Image draw(const Scene& scene, const Camera& camera, int pixels, Method method, int rays,
                  ThreadPool& pool, int subpixels = 2,
                  Reconstruct reconstruct = Reconstruct::kPerPixel) {
    FrameRequest r;
    r.camera = camera;
    r.settings.width = r.settings.height = pixels;
    r.settings.subpixels = subpixels;
    r.settings.method = method;
    r.settings.reconstruct = reconstruct;
    r.settings.samples = rays;
    r.aovs = {"depth", "coverage"};
    return Renderer(scene, pool).render(r).image;
}

}  // namespace stipple
