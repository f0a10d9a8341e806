// SPDX-License-Identifier: Apache-2.0
// A triangle of a block in the picture: the subpixels whose centres it holds, and the depth of its
// plane there. Each centre on an edge that two triangles share belongs to exactly one of them:
// layers of blended surface must not count twice.
#pragma once

#include <core/points.h>

#include <cmath>
#include <utility>

namespace stipple {

// 1 / depth, or depth in orthographic views, which is affine in the picture: q at a place, and by
// how much it grows a subpixel.
struct PicturePlane {
    Vec2 at = Vec2(0);
    float q = 0.0f;
    Vec2 slope = Vec2(0);

    float qAt(const Vec2& p) const { return q + glm::dot(slope, p - at); }
};

class BlendedTriangle {
public:
    BlendedTriangle(const View& view, const TriangleBlock& block, int i)
        : orthographic_(view.orthographic) {
        float q[3];
        for (int k = 0; k < 3; ++k) {
            const Vec3 p = block.vertex(k, i);
            at_[k] = view.project(p);
            nearest_ = std::min(nearest_, p.z);
            q[k] = orthographic_ ? p.z : 1.0f / p.z;
        }
        const Vec2 b = at_[1] - at_[0], c = at_[2] - at_[0];
        area_ = b.x * c.y - b.y * c.x;
        if (area_ == 0.0f || !std::isfinite(area_)) {
            area_ = 0.0f;
            return;
        }
        const float db = q[1] - q[0], dc = q[2] - q[0];
        plane_.at = at_[0];
        plane_.q = q[0];
        plane_.slope = Vec2(db * c.y - dc * b.y, dc * b.x - db * c.x) / area_;
    }
    const PicturePlane& plane() const { return plane_; }
    // Counter-clockwise, y down.
    bool facesEye() const { return area_ < 0.0f; }

    float nearest() const { return nearest_; }  // depth

    // The subpixels of `rect` around all centres that it may hold.
    SubpixelRect bounds(const SubpixelRect& rect) const {
        if (area_ == 0.0f) return {rect.x0, rect.y0, rect.x0, rect.y0};
        const auto bound = [](float v, int lo, int hi) {
            return int(std::ceil(std::clamp(v - 0.5f, float(lo), float(hi))));
        };
        const auto [x_lo, x_hi] = std::minmax({at_[0].x, at_[1].x, at_[2].x});
        const auto [y_lo, y_hi] = std::minmax({at_[0].y, at_[1].y, at_[2].y});
        return {bound(x_lo, rect.x0, rect.x1), bound(y_lo, rect.y0, rect.y1),
                bound(std::nextafter(x_hi, 1e30f) + 1e-3f, rect.x0, rect.x1),
                bound(std::nextafter(y_hi, 1e30f) + 1e-3f, rect.y0, rect.y1)};
    }
    // Calls visit(x, y, depth) for the centres within, of bounds(), for which wants(x, y, depth),
    // and next() after those of each square of `side` subpixels.
    template <class Wants, class Visit, class Next>
    void visit(const SubpixelRect& bounds, int side, const Wants& wants, const Visit& visit,
               const Next& next) const {
        const Edge edges[] = {
            {at_[0], at_[1], at_[2]}, {at_[1], at_[2], at_[0]}, {at_[2], at_[0], at_[1]}};
        for (int top = bounds.y0; top < bounds.y1; top += side - top % side) {
            const int bottom = std::min(bounds.y1, top + side - top % side);
            for (int left = bounds.x0; left < bounds.x1; left += side - left % side) {
                const int right = std::min(bounds.x1, left + side - left % side);
                for (int y = top; y < bottom; ++y) {
                    for (int x = left; x < right; ++x) {
                        const Vec2 p(float(x) + 0.5f, float(y) + 0.5f);
                        const float q = plane_.qAt(p), depth = orthographic_ ? q : 1.0f / q;
                        if (q > 0.0f && wants(x, y, depth) && edges[0].holds(p) &&
                            edges[1].holds(p) && edges[2].holds(p))
                            visit(x, y, depth);
                    }
                }
                next();
            }
        }
    }

private:
    // Both triangles of an edge compute the same number of it; on the edge itself it belongs to the
    // one on its positive side.
    struct Edge {
        double x, y, dx, dy;
        bool is_positive;  // the triangle's side

        Edge(Vec2 a, Vec2 b, const Vec2& opposite) {
            if (std::pair(b.x, b.y) < std::pair(a.x, a.y)) std::swap(a, b);
            x = a.x, y = a.y, dx = double(b.x - a.x), dy = double(b.y - a.y);
            is_positive = side(opposite) > 0.0;
        }
        double side(const Vec2& p) const { return dx * (double(p.y) - y) - dy * (double(p.x) - x); }
        bool holds(const Vec2& p) const { return is_positive ? side(p) >= 0.0 : side(p) < 0.0; }
    };

    const bool orthographic_;
    Vec2 at_[3];
    float area_ = 0.0f;
    float nearest_ = kInfinity;
    PicturePlane plane_;
};

}  // namespace stipple
