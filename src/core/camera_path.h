// SPDX-License-Identifier: Apache-2.0
// A camera that moves: key frames and the smooth curve through them.
#pragma once

#include <core/camera.h>

#include <string>
#include <vector>

namespace stipple {

struct CameraKey {
    double time = 0.0;  // increases from key to key
    DVec3 eye = DVec3(0.0);
    DVec3 aim = DVec3(0.0, 0.0, -1.0);  // what is looked at, or the direction
    double fov_y = 0.8;                 // full vertical angle, radians
};

struct CameraPath {
    std::string name;
    std::vector<CameraKey> keys;  // at least two
    bool aims_are_directions = false;
    DVec3 up = DVec3(0.0, 1.0, 0.0);
    double near_z = 0.05;  // as in Camera
    double far_z = 1e9;
};

// The camera at a share of the path's time: 0 the first key, 1 the last; clamped. Eye, aim and
// angle are cubics between two keys that pass through both with the slope, at each, of the parabola
// through it and its neighbours (Catmull-Rom for keys at unequal times): position and velocity are
// continuous, and keys on a parabola or a line give just that. The angle stays between those of its
// two keys. Where the aim vanishes the key before tells the direction.
Camera cameraAt(const CameraPath& path, double share);

}  // namespace stipple
