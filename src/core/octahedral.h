// SPDX-License-Identifier: Apache-2.0
// Unit vectors as two numbers in [-1, 1]: the sphere on an octahedron, unfolded. Based on: Meyer et
// al. On Floating-Point Normal Vectors. 2010.
#pragma once

#include <core/math.h>

namespace stipple {

// n: not necessarily unit; null gives 0.
inline Vec2 octahedralOf(const Vec3& n) {
    const float s = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    const Vec2 p = s > 0.0f ? Vec2(n.x, n.y) / s : Vec2(0.0f);
    if (!(n.z < 0.0f)) return p;
    return Vec2((1.0f - std::abs(p.y)) * (p.x >= 0.0f ? 1.0f : -1.0f),
                (1.0f - std::abs(p.x)) * (p.y >= 0.0f ? 1.0f : -1.0f));
}

inline Vec3 octahedralNormal(float x, float y) {
    Vec3 n(x, y, 1.0f - std::abs(x) - std::abs(y));
    const float t = std::max(-n.z, 0.0f);
    n.x += n.x >= 0.0f ? -t : t;
    n.y += n.y >= 0.0f ? -t : t;
    return glm::normalize(n);
}

}  // namespace stipple
