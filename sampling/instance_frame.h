// SPDX-License-Identifier: Apache-2.0
// One instance as seen from the eye: all that drawing its points and triangles needs.
#pragma once

#include <core/camera.h>
#include <core/math.h>

namespace stipple {

struct InstanceFrame {
    Affine camera_from_object;      // composed in double, relative to the eye
    DVec3 eye_object = DVec3(0.0);  // the eye (orthographic: the camera's origin) in object space
    double volume_scale = 1.0;      // |determinant| of camera_from_object.linear
    double area_scale = 1.0;        // largest area scale
    Mat3 world_from_normal =
        Mat3(1.0f);  // takes object-space normals to world space (not normalized)
    DVec3 facing =
        DVec3(0.0);     // orthographic: prj(n) = f^2 |n . facing| for a unit area with normal n
    uint64_t path = 0;  // hash of the instance path
};

inline InstanceFrame makeInstanceFrame(const View& view, const Affine& camera_from_object,
                                       uint64_t path) {
    InstanceFrame f;
    f.camera_from_object = camera_from_object;
    const double determinant = glm::determinant(camera_from_object.linear);
    f.volume_scale = std::abs(determinant);
    f.area_scale = maxAreaScale(camera_from_object.linear);
    f.eye_object = glm::inverse(camera_from_object.linear) * -camera_from_object.translation;
    const double sign = determinant < 0.0 ? -1.0 : 1.0;
    const DMat3 area_map = cofactor(camera_from_object.linear) * sign;
    f.world_from_normal = Mat3(glm::transpose(view.camera_from_world) * area_map / f.area_scale);
    f.facing = glm::transpose(area_map) * DVec3(0.0, 0.0, 1.0);
    f.path = path;
    return f;
}

}  // namespace stipple
