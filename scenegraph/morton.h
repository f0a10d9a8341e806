// SPDX-License-Identifier: Apache-2.0
// Morton codes (z-order): neighbours in space are near each other in the order.
#pragma once

#include <core/math.h>

#include <cstdint>

namespace stipple {

// Spreads the low 21 bits of v to every third bit.
inline uint64_t spreadBits(uint64_t v) {
    v &= 0x1fffff;
    v = (v | v << 32) & 0x001f00000000ffffull;
    v = (v | v << 16) & 0x001f0000ff0000ffull;
    v = (v | v << 8) & 0x100f00f00f00f00full;
    v = (v | v << 4) & 0x10c30c30c30c30c3ull;
    return (v | v << 2) & 0x1249249249249249ull;
}

inline constexpr int kMortonLevels = 21;  // bits an axis

// 63-bit code of p within a cube at `origin` of side `side`; clamped to it.
inline uint64_t mortonCode(const DVec3& p, const DVec3& origin, double side) {
    uint64_t code = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double t = std::clamp((p[axis] - origin[axis]) / side, 0.0, 1.0);
        const uint64_t cell = std::min<uint64_t>(uint64_t(t * 0x200000), 0x1fffff);
        code |= spreadBits(cell) << (2 - axis);
    }
    return code;
}

}  // namespace stipple
