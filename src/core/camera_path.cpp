// SPDX-License-Identifier: Apache-2.0
// This work is based on:
// Catmull, Rom. A Class of Local Interpolating Splines. 1974; slopes at unequal distances as in
// Kochanek, Bartels. Interpolating Splines with Local Tension, Continuity, and Bias Control. 1984.
#include <core/camera_path.h>

#include <algorithm>

namespace stipple {

namespace {

// A member's slope at key i: of the parabola through the key and its neighbours, at the ends
// through the nearest three keys.
template <class T>
T slopeAt(const std::vector<CameraKey>& keys, T CameraKey::*member, size_t i) {
    const auto chord = [&](size_t k) {
        return (keys[k + 1].*member - keys[k].*member) / (keys[k + 1].time - keys[k].time);
    };
    if (keys.size() == 2) return chord(0);
    const size_t middle = std::clamp<size_t>(i, 1, keys.size() - 2);
    const double before = keys[middle].time - keys[middle - 1].time,
                 behind = keys[middle + 1].time - keys[middle].time;
    const T left = chord(middle - 1), right = chord(middle);
    const T bend = (right - left) / (before + behind);  // half the second derivative
    return left + bend * (before + 2.0 * (keys[i].time - keys[middle].time));
}

// At t of the way from key i to the next.
template <class T>
T hermite(const std::vector<CameraKey>& keys, T CameraKey::*member, size_t i, double t) {
    const double step = keys[i + 1].time - keys[i].time, s = 1.0 - t;
    return (keys[i].*member) * (s * s * (1.0 + 2.0 * t)) +
           slopeAt(keys, member, i) * (step * s * s * t) +
           (keys[i + 1].*member) * (t * t * (1.0 + 2.0 * s)) -
           slopeAt(keys, member, i + 1) * (step * t * t * s);
}

}  // namespace

Camera cameraAt(const CameraPath& path, double share) {
    const std::vector<CameraKey>& keys = path.keys;
    const double time = glm::mix(keys.front().time, keys.back().time, std::clamp(share, 0.0, 1.0));
    size_t i = 0;
    while (i + 2 < keys.size() && time >= keys[i + 1].time) ++i;
    const CameraKey &from = keys[i], &to = keys[i + 1];
    const double t = std::clamp((time - from.time) / (to.time - from.time), 0.0, 1.0);

    const auto direction = [&](const DVec3& aim, const DVec3& eye) {
        return path.aims_are_directions ? aim : aim - eye;
    };
    const DVec3 eye = hermite(keys, &CameraKey::eye, i, t);
    DVec3 forward = direction(hermite(keys, &CameraKey::aim, i, t), eye);
    if (!(glm::length(forward) > 1e-9)) forward = direction(from.aim, from.eye);
    // Relative to the eye: far from the origin an eye and a target near it lose digits.
    Camera camera = lookAt(DVec3(0.0), forward, path.up);
    camera.name = path.name;
    camera.eye = eye;
    camera.fov_y = std::clamp(hermite(keys, &CameraKey::fov_y, i, t),
                              std::min(from.fov_y, to.fov_y), std::max(from.fov_y, to.fov_y));
    camera.near_z = path.near_z;
    camera.far_z = path.far_z;
    return camera;
}

}  // namespace stipple
