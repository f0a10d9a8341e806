// SPDX-License-Identifier: Apache-2.0
// Vectors, boxes and affine maps that every layer shares. GLM underneath; column vectors,
// right-handed, metres. Spaces are named in variables: p_world, n_object; a transform from object
// to world space is world_from_object.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>

namespace stipple {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Vec4 = glm::vec4;
using DVec2 = glm::dvec2;
using DVec3 = glm::dvec3;
using Mat3 = glm::mat3;
using DMat3 = glm::dmat3;
using UVec3 = glm::uvec3;

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

inline double radians(double degrees) { return degrees * (kPi / 180.0); }

// Two unit vectors that with the unit vector n are a right-handed frame (u, v, n). Based on: Duff
// et al. Building an Orthonormal Basis, Revisited. 2017.
inline void tangents(const Vec3& n, Vec3& u, Vec3& v) {
    const float sign = std::copysign(1.0f, n.z), a = -1.0f / (sign + n.z), b = n.x * n.y * a;
    u = Vec3(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
    v = Vec3(b, sign + n.y * n.y * a, -n.y);
}

// Axis-aligned box. Empty (min > max) by default; extend() makes it grow.
template <class V>
struct BoxT {
    V min = V(std::numeric_limits<typename V::value_type>::max());
    V max = V(std::numeric_limits<typename V::value_type>::lowest());

    bool isEmpty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
    void extend(const V& p) { min = glm::min(min, p), max = glm::max(max, p); }
    void extend(const BoxT& b) { min = glm::min(min, b.min), max = glm::max(max, b.max); }
    V center() const { return (min + max) * typename V::value_type(0.5); }
    V extent() const { return max - min; }
    V corner(int i) const {
        return V(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z);
    }
};
using Box3 = BoxT<Vec3>;
using DBox3 = BoxT<DVec3>;

// The smallest box of floats that contains `b` (rounded outwards).
inline Box3 enclosingFloatBox(const DBox3& b) {
    Box3 r{Vec3(b.min), Vec3(b.max)};
    for (int i = 0; i < 3; ++i) {
        if (double(r.min[i]) > b.min[i]) r.min[i] = std::nextafter(r.min[i], -kInfinity);
        if (double(r.max[i]) < b.max[i]) r.max[i] = std::nextafter(r.max[i], kInfinity);
    }
    return r;
}

// p_target = linear * p_source + translation, in double: scenes are 250 km wide and leaves 9 cm.
struct Affine {
    DMat3 linear = DMat3(1.0);
    DVec3 translation = DVec3(0.0);

    DVec3 point(const DVec3& p) const { return linear * p + translation; }
};

inline Affine operator*(const Affine& c_from_b, const Affine& b_from_a) {
    return {c_from_b.linear * b_from_a.linear,
            c_from_b.linear * b_from_a.translation + c_from_b.translation};
}

inline Affine inverse(const Affine& b_from_a) {
    const DMat3 l = glm::inverse(b_from_a.linear);
    return {l, -(l * b_from_a.translation)};
}

inline bool isFinite(const DVec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline bool isFinite(const Affine& a) {
    return isFinite(a.linear[0]) && isFinite(a.linear[1]) && isFinite(a.linear[2]) &&
           isFinite(a.translation);
}

// Box of the transformed box's corners.
template <class V>
inline DBox3 transformBox(const Affine& b_from_a, const BoxT<V>& box) {
    DBox3 r;
    if (box.isEmpty()) return r;
    for (int i = 0; i < 8; ++i) r.extend(b_from_a.point(DVec3(box.corner(i))));
    return r;
}

// Cofactor matrix: maps area vectors (normal times area) as `m` maps points; also right for
// mirrored maps.
inline DMat3 cofactor(const DMat3& m) {
    return DMat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
}

// The largest factor by which `m` scales an area: the product of its two largest singular values.
// For a similarity this is exact; otherwise an upper bound that is at most sqrt(3) too large.
double maxAreaScale(const DMat3& m);
// The largest factor by which `m` scales a length (an upper bound of the largest singular value, at
// most sqrt(3) off).
double maxLengthScale(const DMat3& m);

}  // namespace stipple
