// SPDX-License-Identifier: Apache-2.0
#include <sampling/projection.h>

namespace stipple {

namespace {

constexpr double kFlatRatio = 1.01;

}  // namespace

BoxProjection projectBox(const View& view, const DMat3& linear, const DVec3& translation,
                         const Box3& box) {
    BoxProjection r;
    if (box.isEmpty()) return r;
    const DVec3 center = linear * DVec3(box.center()) + translation;
    const DVec3 half = DVec3(box.extent()) * 0.5;
    const DVec3 ax = linear[0] * half.x, ay = linear[1] * half.y, az = linear[2] * half.z;
    const double dz = std::abs(ax.z) + std::abs(ay.z) + std::abs(az.z);
    const double z_min = center.z - dz, z_max = center.z + dz;
    if (z_max < view.near_z || z_min > view.far_z) return r;

    // Frustum planes: how far all corners lie outside or inside each side.
    const double width = view.subWidth(), height = view.subHeight();
    const auto planeRange = [&](const DVec3& n, double offset, double& lo, double& hi) {
        const double c = glm::dot(n, center) + offset;
        const double e =
            std::abs(glm::dot(n, ax)) + std::abs(glm::dot(n, ay)) + std::abs(glm::dot(n, az));
        lo = c - e, hi = c + e;
    };
    const double f = view.focal;
    bool inside = z_min >= view.near_z && z_max <= view.far_z;
    const double left = -view.center_x / f, right = (width - view.center_x) / f;
    const double top = -view.center_y / f, bottom = (height - view.center_y) / f;
    const DVec3 normals[4] = {{1, 0, view.orthographic ? 0 : -left},
                              {-1, 0, view.orthographic ? 0 : right},
                              {0, 1, view.orthographic ? 0 : -top},
                              {0, -1, view.orthographic ? 0 : bottom}};
    const double offsets[4] = {-left, right, -top, bottom};
    for (int i = 0; i < 4; ++i) {
        double lo, hi;
        planeRange(normals[i], view.orthographic ? offsets[i] : 0.0, lo, hi);
        if (hi < 0.0) return r;
        inside = inside && lo >= 0.0;
    }
    r.is_visible = true;
    r.is_inside = inside;
    r.z_min = float(std::max(z_min, double(view.near_z)));
    if (z_min < view.near_z) {
        r.rect = {0, 0, view.subWidth(), view.subHeight()};
        r.size = r.thickness = kInfinity;
        r.depth_ratio = std::numeric_limits<double>::infinity();
        r.bound = std::numeric_limits<double>::infinity();
        return r;
    }
    r.depth_ratio = view.orthographic ? 1.0 : z_max / z_min;
    double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300, stretch = 0.0;
    if (r.depth_ratio < kFlatRatio) {
        // Far boxes: every corner at both depths; hardly looser, and two divisions instead of
        // eight.
        const double ex = std::abs(ax.x) + std::abs(ay.x) + std::abs(az.x);
        const double ey = std::abs(ax.y) + std::abs(ay.y) + std::abs(az.y);
        const double s_near = view.orthographic ? 1.0 : 1.0 / z_min,
                     s_far = view.orthographic ? 1.0 : 1.0 / z_max;
        x0 = std::min((center.x - ex) * s_near, (center.x - ex) * s_far);
        x1 = std::max((center.x + ex) * s_near, (center.x + ex) * s_far);
        y0 = std::min((center.y - ey) * s_near, (center.y - ey) * s_far);
        y1 = std::max((center.y + ey) * s_near, (center.y + ey) * s_far);
        stretch = std::max(x0 * x0, x1 * x1) + std::max(y0 * y0, y1 * y1);
    } else {
        for (int i = 0; i < 8; ++i) {
            const DVec3 p = center + (i & 1 ? ax : -ax) + (i & 2 ? ay : -ay) + (i & 4 ? az : -az);
            const double x = p.x / p.z, y = p.y / p.z;
            x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
            stretch = std::max(stretch, x * x + y * y);
        }
    }
    const auto clampTo = [](double v, double limit) { return int(std::clamp(v, 0.0, limit)); };
    r.rect = {clampTo(std::floor(view.center_x + x0 * f), width),
              clampTo(std::floor(view.center_y + y0 * f), height),
              clampTo(std::floor(view.center_x + x1 * f) + 1.0, width),
              clampTo(std::floor(view.center_y + y1 * f) + 1.0, height)};
    r.size = float(std::max(x1 - x0, y1 - y0) * f);
    r.thickness = float(std::min(x1 - x0, y1 - y0) * f);
    r.bound = view.orthographic ? f * f : f * f * std::sqrt(1.0 + stretch) / (z_min * z_min);
    return r;
}

}  // namespace stipple
