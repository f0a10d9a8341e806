// SPDX-License-Identifier: Apache-2.0
#include <tools/view_camera.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr double kSteepest = 1.5;  // radians above or below the horizon

DVec3 forwardOf(const Camera& camera) { return camera.world_from_camera[2]; }

Camera aimed(Camera camera, const DVec3& eye, const DVec3& forward) {
    const Camera aimed = lookAt(eye, eye + forward);
    camera.eye = eye;
    camera.world_from_camera = aimed.world_from_camera;
    return camera;
}

DVec3 rotated(const DVec3& v, const DVec3& axis, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return v * c + glm::cross(axis, v) * s + axis * glm::dot(axis, v) * (1.0 - c);
}

// The pitch that keeps the view from tipping over.
double allowed(const DVec3& forward, double pitch) {
    const double now = std::asin(std::clamp(forward.y, -1.0, 1.0));
    return std::clamp(now + pitch, -kSteepest, kSteepest) - now;
}

}  // namespace

Camera turned(const Camera& camera, double yaw, double pitch) {
    DVec3 forward = forwardOf(camera);
    pitch = allowed(forward, pitch);
    const DVec3 right = glm::normalize(glm::cross(forward, DVec3(0, 1, 0)));
    forward = rotated(rotated(forward, right, pitch), DVec3(0, 1, 0), -yaw);
    return aimed(camera, camera.eye, forward);
}

Camera orbited(const Camera& camera, const DVec3& about, double yaw, double pitch) {
    DVec3 forward = forwardOf(camera);
    pitch = allowed(forward, pitch);
    const DVec3 right = glm::normalize(glm::cross(forward, DVec3(0, 1, 0)));
    const auto turn = [&](const DVec3& v) {
        return rotated(rotated(v, right, pitch), DVec3(0, 1, 0), -yaw);
    };
    return aimed(camera, about + turn(camera.eye - about), turn(forward));
}

Camera flown(const Camera& camera, const DVec3& step) {
    Camera result = camera;
    result.eye +=
        camera.world_from_camera[0] * step.x + DVec3(0, 1, 0) * step.y + forwardOf(camera) * step.z;
    return result;
}

DVec3 worldPoint(const View& view, double x, double y, double depth) {
    Vec3 origin, direction;
    view.ray(float((x + 0.5) * view.subpixels), float((y + 0.5) * view.subpixels), origin,
             direction);
    const DVec3 p = DVec3(origin) + DVec3(direction) * depth;
    return view.eye_world + glm::transpose(DMat3(view.camera_from_world)) * p;
}

}  // namespace stipple
