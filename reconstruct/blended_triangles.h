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

    // Calls visit(x, y, depth) for the centres within.
    template <class Visit>
    void visit(const SubpixelRect& rect, const Visit& visit) const {
        if (area_ == 0.0f) return;
        const auto bound = [](float v, int lo, int hi) {
            return int(std::ceil(std::clamp(v - 0.5f, float(lo), float(hi))));
        };
        const auto [x_lo, x_hi] = std::minmax({at_[0].x, at_[1].x, at_[2].x});
        const auto [y_lo, y_hi] = std::minmax({at_[0].y, at_[1].y, at_[2].y});
        const int x0 = bound(x_lo, rect.x0, rect.x1),
                  x1 = bound(std::nextafter(x_hi, 1e30f) + 1e-3f, rect.x0, rect.x1);
        const int y0 = bound(y_lo, rect.y0, rect.y1),
                  y1 = bound(std::nextafter(y_hi, 1e30f) + 1e-3f, rect.y0, rect.y1);
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                const Vec2 p(float(x) + 0.5f, float(y) + 0.5f);
                if (!holds(p)) continue;
                const float q = plane_.qAt(p);
                if (q > 0.0f) visit(x, y, orthographic_ ? q : 1.0f / q);
            }
        }
    }

private:
    bool holds(const Vec2& p) const {
        return isInside(0, 1, 2, p) && isInside(1, 2, 0, p) && isInside(2, 0, 1, p);
    }
    // Both triangles of an edge compute the same number of it; on the edge itself it belongs to the
    // one on its positive side.
    bool isInside(int i, int j, int opposite, const Vec2& p) const {
        Vec2 a = at_[i], b = at_[j];
        if (std::pair(b.x, b.y) < std::pair(a.x, a.y)) std::swap(a, b);
        const auto side = [&](const Vec2& v) {
            return double(b.x - a.x) * double(v.y - a.y) - double(b.y - a.y) * double(v.x - a.x);
        };
        const double of_p = side(p);
        return side(at_[opposite]) > 0.0 ? of_p >= 0.0 : of_p < 0.0;
    }

    const bool orthographic_;
    Vec2 at_[3];
    float area_ = 0.0f;
    PicturePlane plane_;
};

}  // namespace stipple
