// SPDX-License-Identifier: Apache-2.0
// One instance as seen from the eye: all that drawing its points and triangles needs.
#pragma once

#include <core/math.h>

namespace stipple {

struct InstanceFrame {
    Affine camera_from_object;      // composed in double, relative to the eye
    DVec3 eye_object = DVec3(0.0);  // the eye (orthographic: the camera's origin) in object space
    double volume_scale = 1.0;      // |determinant| of camera_from_object.linear
    double area_scale = 1.0;        // largest area scale
    Mat3 camera_from_normal = Mat3(1.0f);  // takes object-space normals to camera space (not unit)
    DVec3 facing =
        DVec3(0.0);     // orthographic: prj(n) = f^2 |n . facing| for a unit area with normal n
    uint64_t path = 0;  // hash of the instance path
};

inline InstanceFrame makeInstanceFrame(const Affine& camera_from_object, uint64_t path) {
    InstanceFrame f;
    f.camera_from_object = camera_from_object;
    const DMat3& linear = camera_from_object.linear;
    DMat3 area_map = cofactor(linear);
    const double determinant = glm::dot(linear[0], area_map[0]);
    f.volume_scale = std::abs(determinant);
    f.area_scale = maxAreaScale(linear);
    // The inverse is the transposed cofactor matrix over the determinant.
    const DVec3& t = camera_from_object.translation;
    f.eye_object =
        DVec3(glm::dot(area_map[0], t), glm::dot(area_map[1], t), glm::dot(area_map[2], t)) /
        -determinant;
    area_map *= determinant < 0.0 ? -1.0 : 1.0;
    f.camera_from_normal = Mat3(area_map / f.area_scale);
    f.facing = DVec3(area_map[0].z, area_map[1].z, area_map[2].z);
    f.path = path;
    return f;
}

}  // namespace stipple
