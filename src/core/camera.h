// SPDX-License-Identifier: Apache-2.0
// Camera (as scenes describe it) and View (a camera at a resolution, as all drawing code sees it).
#pragma once

#include <core/math.h>

#include <string>

namespace stipple {

// Camera space: x right, y down, z forward; the origin is the eye. Depth is camera z, everywhere.
struct Camera {
    std::string name;
    DVec3 eye = DVec3(0.0, 0.0, 5.0);  // world
    DMat3 world_from_camera =
        DMat3(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);  // columns: right, down, forward
    bool orthographic = false;
    double fov_y = 0.8;    // perspective: full vertical angle, radians
    double height = 10.0;  // orthographic: height of the picture, metres
    double near_z = 0.05;  // nothing nearer is drawn
    double far_z = 1e9;    // nothing farther is drawn
};

// Camera at `eye` looking at `target`. `up` must not be parallel to the direction (then another is
// chosen).
Camera lookAt(const DVec3& eye, const DVec3& target, const DVec3& up = DVec3(0, 1, 0));

// A camera at a resolution. Pixel (x, y) covers [x, x+1) x [y, y+1); (0, 0) is the top left corner;
// every pixel has subpixels x subpixels subpixels, whose coordinates are pixel coordinates times
// `subpixels`.
struct View {
    int width = 0;      // pixels
    int height = 0;     // pixels
    int subpixels = 1;  // along one side of a pixel
    bool orthographic = false;
    DVec3 eye_world = DVec3(0.0);
    DMat3 camera_from_world = DMat3(1.0);  // rotation about the eye; see turnTo()
    Mat3 world_from_camera = Mat3(1.0f);   // its inverse
    double focal = 1.0;     // subpixels per unit of x/z (perspective) or per metre (orthographic)
    double center_x = 0.0;  // subpixel coordinates of the optical axis
    double center_y = 0.0;
    float near_z = 0.05f;
    float far_z = 1e9f;

    void turnTo(const DMat3& rotation) {
        camera_from_world = rotation;
        world_from_camera = Mat3(glm::transpose(rotation));
    }
    int subWidth() const { return width * subpixels; }
    int subHeight() const { return height * subpixels; }
    // Subpixel coordinates of a point in camera space (z > 0).
    Vec2 project(const Vec3& p_camera) const {
        const float s = orthographic ? float(focal) : float(focal) / p_camera.z;
        return Vec2(float(center_x) + p_camera.x * s, float(center_y) + p_camera.y * s);
    }
    // Camera-space ray through subpixel coordinates: p = origin + t * direction has depth t
    // (direction.z is 1).
    void ray(float sub_x, float sub_y, Vec3& origin, Vec3& direction) const;
};

// Throws kInvalidArgument for sizes out of range (1..65536 a side, subpixels 1..16, at most 2^28
// pixels).
View makeView(const Camera& camera, int width, int height, int subpixels);

}  // namespace stipple
