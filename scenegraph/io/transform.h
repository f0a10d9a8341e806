// SPDX-License-Identifier: Apache-2.0
// Transforms as files write them.
#pragma once

#include <core/math.h>

namespace stipple {

// From 16 numbers, column by column. False if the last row is not 0 0 0 1.
inline bool affineFromMatrix(const double* m, Affine& result) {
    constexpr double kTolerance = 1e-6;
    if (std::max({std::abs(m[3]), std::abs(m[7]), std::abs(m[11]), std::abs(m[15] - 1.0)}) >
        kTolerance)
        return false;
    result.linear = DMat3(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    result.translation = DVec3(m[12], m[13], m[14]);
    return true;
}

// From a quaternion x, y, z, w, of any length but zero. False if it is zero.
inline bool rotationFromQuaternion(const double* q, DMat3& result) {
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(length > 1e-12) || !std::isfinite(length)) return false;
    const double x = q[0] / length, y = q[1] / length, z = q[2] / length, w = q[3] / length;
    result = DMat3(1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w),  //
                   2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w),  //
                   2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y));
    return true;
}

// Turns about x, then y, then z (the axes of the parent), in radians.
inline DMat3 rotationFromEuler(const DVec3& angles) {
    const DVec3 c = glm::cos(angles), s = glm::sin(angles);
    const DMat3 rx(1, 0, 0, 0, c.x, s.x, 0, -s.x, c.x), ry(c.y, 0, -s.y, 0, 1, 0, s.y, 0, c.y),
        rz(c.z, s.z, 0, -s.z, c.z, 0, 0, 0, 1);
    return rz * ry * rx;
}

inline Affine affineFromParts(const DVec3& translation, const DMat3& rotation, const DVec3& scale) {
    return {DMat3(rotation[0] * scale.x, rotation[1] * scale.y, rotation[2] * scale.z),
            translation};
}

// Flattens what it maps, or as good as: it makes less than 2e-12 of a cube's volume out of it,
// measured by its longest stretch. (A little stricter than what buildScene() refuses.)
inline bool isSingular(const DMat3& m) {
    const double length = maxLengthScale(m);
    return !(std::abs(glm::determinant(m)) > 2e-12 * length * length * length);
}

}  // namespace stipple
