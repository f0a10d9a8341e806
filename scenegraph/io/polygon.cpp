// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/polygon.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr size_t kMostEarCorners = 1000;

double cross(const DVec2& a, const DVec2& b) { return a.x * b.y - a.y * b.x; }

bool isInside(const DVec2& p, const DVec2& a, const DVec2& b, const DVec2& c) {
    return cross(b - a, p - a) >= 0.0 && cross(c - b, p - b) >= 0.0 && cross(a - c, p - c) >= 0.0;
}

// The corners on the plane that they lie nearest to, counter-clockwise.
std::vector<DVec2> project(const std::vector<Vec3>& positions, std::span<const uint32_t> polygon) {
    const DVec3 origin(positions[polygon[0]]);
    DVec3 normal(0.0);  // Newell's: the sum of the fan's area vectors
    for (size_t i = 1; i + 1 < polygon.size(); ++i) {
        normal += glm::cross(DVec3(positions[polygon[i]]) - origin,
                             DVec3(positions[polygon[i + 1]]) - origin);
    }
    const DVec3 size = glm::abs(normal);
    const int axis = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
    const double side = normal[axis] < 0.0 ? -1.0 : 1.0;
    std::vector<DVec2> corners;
    for (const uint32_t index : polygon) {
        const DVec3 p = DVec3(positions[index]) - origin;
        corners.emplace_back(p[(axis + 1) % 3] * side, p[(axis + 2) % 3]);
    }
    return corners;
}

}  // namespace

void triangulatePolygon(const std::vector<Vec3>& positions, std::span<const uint32_t> polygon,
                        std::vector<UVec3>& triangles) {
    if (polygon.size() < 3) return;
    std::vector<uint32_t> left(polygon.size());  // corners not yet clipped
    for (size_t i = 0; i < left.size(); ++i) left[i] = uint32_t(i);
    if (polygon.size() > 3 && polygon.size() <= kMostEarCorners) {
        const std::vector<DVec2> p = project(positions, polygon);
        const auto isEar = [&](size_t i) {
            const size_t n = left.size();
            const uint32_t a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
            if (!(cross(p[b] - p[a], p[c] - p[b]) > 0.0)) return false;
            return std::none_of(left.begin(), left.end(), [&](uint32_t other) {
                return other != a && other != b && other != c && p[other] != p[a] &&
                       p[other] != p[b] && p[other] != p[c] && isInside(p[other], p[a], p[b], p[c]);
            });
        };
        // The second corner first: what is convex becomes the fan from the first corner. Then on
        // from the last ear, or hostile polygons would take cubic time.
        size_t ear = 1;
        while (left.size() > 3) {
            const size_t n = left.size();
            size_t tried = 0;
            for (ear %= n; tried < n && !isEar(ear); ++tried) ear = (ear + 1) % n;
            if (tried == n) break;  // it cuts itself
            triangles.emplace_back(polygon[left[(ear + n - 1) % n]], polygon[left[ear]],
                                   polygon[left[(ear + 1) % n]]);
            left.erase(left.begin() + std::ptrdiff_t(ear));
        }
    }
    for (size_t i = 1; i + 1 < left.size(); ++i)
        triangles.emplace_back(polygon[left[0]], polygon[left[i]], polygon[left[i + 1]]);
}

}  // namespace stipple
