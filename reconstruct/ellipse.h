// SPDX-License-Identifier: Apache-2.0
// A surfel in the picture: a disc's ellipse around its projected centre, a filter kernel of that
// shape, and the depth of its plane.
// Based on: Ni. Hybrid 3D-Model Representation. 2005 (J V J^T + I); Zwicker et al. EWA Splatting.
// 2002.
#pragma once

#include <core/points.h>

#include <algorithm>
#include <cmath>

namespace stipple {

// Symmetric 2 x 2 matrix of a Gaussian's variance, in subpixels squared.
struct Variance {
    float xx = 0.0f, xy = 0.0f, yy = 0.0f;

    // With an isotropic Gaussian added.
    Variance plus(float variance) const { return {xx + variance, xy, yy + variance}; }
    Variance times(float scale) const { return {xx * scale, xy * scale, yy * scale}; }
    float determinant() const { return xx * yy - xy * xy; }
    // d^T v^-1 d.
    float measure(const Vec2& d) const {
        return (yy * d.x * d.x - 2.0f * xy * d.x * d.y + xx * d.y * d.y) / determinant();
    }
};

struct Ellipse {
    Vec2 center = Vec2(0);  // subpixels
    Variance unit;          // J J^T: of a disc of radius 1 m
    // Depth of the plane at the centre + d: 1 / (q + dot(slope, d)), or q + dot(slope, d) in
    // orthographic views.
    float q = 0.0f;
    Vec2 slope = Vec2(0);
    float cosine = 1.0f;  // between normal and ray, at least kEdgeOn

    // Planes seen more edge-on than this are turned towards the eye.
    static constexpr float kEdgeOn = 0.1f;
};

// A plane that is seen too edge-on turned towards the eye. n: unit; becomes the side that faces
// away.
inline void turnToEye(const View& view, const Vec3& p, Vec3& n, Ellipse& e) {
    const Vec3 ray = view.orthographic ? Vec3(0, 0, 1) : p / glm::length(p);
    float cosine = glm::dot(n, ray);
    if (cosine < 0.0f) n = -n, cosine = -cosine;
    if (cosine < Ellipse::kEdgeOn) {
        n = glm::normalize(n + ray * (Ellipse::kEdgeOn - cosine));
        cosine = glm::dot(n, ray);
    }
    e.cosine = cosine;
}

// The ellipse around p in the plane of the unit normal n whose half axes (for affine images of a
// circle: conjugate ones) are s and t, m.
inline void projectEllipse(const View& view, const Vec3& p, const Vec3& n, const Vec3& s,
                           const Vec3& t, Ellipse& e) {
    e.center = view.project(p);
    const float f = float(view.focal);
    Vec2 js, jt;
    if (view.orthographic) {
        js = Vec2(s.x, s.y) * f, jt = Vec2(t.x, t.y) * f;
        e.q = p.z;
        e.slope = Vec2(n.x, n.y) * (-1.0f / (f * n.z));
    } else {
        const float scale = f / (p.z * p.z);
        js = Vec2(s.x * p.z - s.z * p.x, s.y * p.z - s.z * p.y) * scale;
        jt = Vec2(t.x * p.z - t.z * p.x, t.y * p.z - t.z * p.y) * scale;
        // On the plane n.p = d, 1 / z is affine in the picture.
        const float d = glm::dot(n, p);
        e.q = 1.0f / p.z;
        e.slope = Vec2(n.x, n.y) / (f * d);
    }
    e.unit = {js.x * js.x + jt.x * jt.x, js.x * js.y + jt.x * jt.y, js.y * js.y + jt.y * jt.y};
}

// Of a circle. p, n: centre and unit normal in camera space.
inline Ellipse makeEllipse(const View& view, const Vec3& p, Vec3 n) {
    Ellipse e;
    turnToEye(view, p, n, e);
    const Vec3 s =
        glm::normalize(std::abs(n.z) > std::abs(n.x) ? Vec3(0, n.z, -n.y) : Vec3(-n.y, n.x, 0));
    projectEllipse(view, p, n, s, glm::cross(n, s), e);
    return e;
}

// Of a disc with a shape of its own, whose plane is that of its axes.
inline Ellipse makeEllipse(const View& view, const Vec3& p, const DiscShape& shape) {
    Ellipse e;
    Vec3 n = glm::normalize(glm::cross(shape.axis[0], shape.axis[1]));
    turnToEye(view, p, n, e);
    projectEllipse(view, p, n, shape.axis[0] - n * glm::dot(n, shape.axis[0]),
                   shape.axis[1] - n * glm::dot(n, shape.axis[1]), e);
    return e;
}

// Places on a disc with a shape, by where they are in the picture.
class DiscPlaces {
public:
    DiscPlaces(const View& view, const Vec3& p, const DiscShape& shape)
        : view_(view), p_(p), shape_(shape) {
        const Vec3 n = glm::cross(shape.axis[0], shape.axis[1]);
        const float squared = glm::dot(n, n);
        across_[0] = glm::cross(shape.axis[1], n) / squared;
        across_[1] = glm::cross(n, shape.axis[0]) / squared;
    }
    // u and v. x, y: subpixel coordinates; depth: of the disc's plane there.
    Vec2 at(float x, float y, float depth) const {
        Vec3 origin, direction;
        view_.ray(x, y, origin, direction);
        const Vec3 d = origin + direction * depth - p_;
        return Vec2(glm::dot(d, across_[0]), glm::dot(d, across_[1]));
    }
    bool hasSurface(float x, float y, float depth) const {
        if (shape_.n_cuts == 0) return true;
        const Vec2 uv = at(x, y, depth);
        return shape_.hasSurface(uv.x, uv.y);
    }

private:
    const View& view_;
    const Vec3 p_;
    const DiscShape& shape_;
    std::array<Vec3, 2> across_ = {};  // u and v of an offset
};

// Depth of the plane there; infinite where it is more than four times as far as the centre, or not
// in front of the eye: no disc that is drawn as an ellipse reaches there.
inline float planeDepth(const View& view, const Ellipse& e, const Vec2& d) {
    const float q = e.q + glm::dot(e.slope, d);
    if (view.orthographic) return q;
    return q > 0.25f * e.q ? 1.0f / q : kInfinity;
}

// Calls visit(x, y, d, r) for the centres at d from the ellipse's centre, within x0..y1, for which
// r = d^T v^-1 d < r_max.
template <class Visit>
void visitEllipse(const Vec2& center, const Variance& v, float r_max, int x0, int y0, int x1,
                  int y1, const Visit& visit) {
    const float det = v.determinant();
    if (!(det > 0.0f)) return;
    const float a = v.yy / det, b = -v.xy / det, c = v.xx / det;
    const float half_x = std::sqrt(r_max * v.xx), half_y = std::sqrt(r_max * v.yy);
    // Clamped before they become integers.
    const auto first = [](float value, int lo, int hi) {
        return int(std::ceil(std::clamp(value, float(lo), float(hi))));
    };
    const int left = first(center.x - half_x - 0.5f, x0, x1),
              right = first(center.x + half_x - 0.5f, x0, x1);
    const int top = first(center.y - half_y - 0.5f, y0, y1),
              bottom = first(center.y + half_y - 0.5f, y0, y1);
    for (int y = top; y < bottom; ++y) {
        const float dy = float(y) + 0.5f - center.y;
        for (int x = left; x < right; ++x) {
            const float dx = float(x) + 0.5f - center.x;
            const float r = a * dx * dx + 2.0f * b * dx * dy + c * dy * dy;
            if (r < r_max) visit(x, y, Vec2(dx, dy), r);
        }
    }
}

// The kernel: (1 - r / 8)^4, which is exp(-r / 2) within 0.09 and ends at r = 8.
inline constexpr float kKernelEnd = 8.0f;
inline float kernel(float r) {
    const float t = 1.0f - r * (1.0f / kKernelEnd);
    return t * t * t * t;
}
// Its integral over the picture.
inline float kernelIntegral(const Variance& v) {
    return 1.6f * 3.14159265f * std::sqrt(std::max(v.determinant(), 0.0f));
}

}  // namespace stipple
