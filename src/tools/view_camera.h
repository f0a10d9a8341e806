// SPDX-License-Identifier: Apache-2.0
// How mouse and keys move the viewer's camera. Plain functions of cameras.
#pragma once

#include <core/camera.h>

namespace stipple {

// Turns the camera about a point of the world: angles in radians, about the vertical and about the
// camera's right. It never tips over.
Camera orbited(const Camera& camera, const DVec3& about, double yaw, double pitch);
// Turns it where it stands.
Camera turned(const Camera& camera, double yaw, double pitch);
// Moves it along its right, the vertical and its view, metres.
Camera flown(const Camera& camera, const DVec3& right_up_forward);

// The point of the world that a picture shows at a pixel, in linear depth z; by the pixel's centre.
DVec3 worldPoint(const View& view, double x, double y, double depth);

}  // namespace stipple
