// SPDX-License-Identifier: Apache-2.0
#include <core/camera.h>
#include <core/error.h>

namespace stipple {

Camera lookAt(const DVec3& eye, const DVec3& target, const DVec3& up) {
    Camera camera;
    const DVec3 forward = glm::normalize(target - eye);
    DVec3 right = glm::cross(forward, up);
    if (glm::dot(right, right) < 1e-12 * glm::dot(up, up)) {
        right = glm::cross(forward, std::abs(forward.x) < 0.9 ? DVec3(1, 0, 0) : DVec3(0, 0, 1));
    }
    right = glm::normalize(right);
    camera.eye = eye;
    camera.world_from_camera = DMat3(right, glm::cross(forward, right), forward);
    return camera;
}

void View::ray(float sub_x, float sub_y, Vec3& origin, Vec3& direction) const {
    const float x = float((sub_x - center_x) / focal), y = float((sub_y - center_y) / focal);
    origin = orthographic ? Vec3(x, y, 0.0f) : Vec3(0.0f);
    direction = orthographic ? Vec3(0.0f, 0.0f, 1.0f) : Vec3(x, y, 1.0f);
}

View makeView(const Camera& camera, int width, int height, int subpixels) {
    if (width < 1 || height < 1 || width > 65536 || height > 65536 ||
        int64_t(width) * height > (int64_t(1) << 28)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "picture size " + std::to_string(width) + "x" + std::to_string(height) +
                        " is out of range (1..65536 a side, at most 2^28 pixels)");
    }
    if (subpixels < 1 || subpixels > 16) {
        throw Error(ErrorCode::kInvalidArgument, "", "subpixels must be in 1..16");
    }
    View view;
    view.width = width;
    view.height = height;
    view.subpixels = subpixels;
    view.orthographic = camera.orthographic;
    view.eye_world = camera.eye;
    view.turnTo(glm::transpose(camera.world_from_camera));
    view.focal = camera.orthographic ? view.subHeight() / camera.height
                                     : 0.5 * view.subHeight() / std::tan(0.5 * camera.fov_y);
    view.center_x = 0.5 * view.subWidth();
    view.center_y = 0.5 * view.subHeight();
    view.near_z = float(camera.near_z);
    view.far_z = float(camera.far_z);
    return view;
}

}  // namespace stipple
