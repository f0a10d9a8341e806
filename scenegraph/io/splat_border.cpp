// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_border.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr float kCorner = 1.1547f;  // a hexagon around the ellipse is drawn

constexpr float kBorderGap = 1.5f;  // spacings between a cut and the last point
// A cut that takes away less than this share of what is left is not worth its triangle.
constexpr float kLeastShare = 0.06f;

double areaOf(const std::vector<Vec2>& corners) {
    double twice = 0.0;
    for (size_t i = 0; i < corners.size(); ++i) {
        const Vec2 &a = corners[i], &b = corners[(i + 1) % corners.size()];
        twice += double(a.x) * b.y - double(a.y) * b.x;
    }
    return 0.5 * twice;
}

// What of a convex polygon lies on this side of the line x to.x + y to.y = end.
void clip(const std::vector<Vec2>& corners, const Vec2& to, float end, std::vector<Vec2>& kept) {
    kept.clear();
    for (size_t i = 0; i < corners.size(); ++i) {
        const Vec2 &a = corners[i], &b = corners[(i + 1) % corners.size()];
        const float da = glm::dot(to, a) - end, db = glm::dot(to, b) - end;
        if (da <= 0.0f) kept.push_back(a);
        if ((da < 0.0f) != (db < 0.0f) && da != db) kept.push_back(a + (b - a) * (da / (da - db)));
    }
}

// Convex hull, counter-clockwise: Andrew's monotone chain. Sorts the points.
std::vector<Vec2> hullOf(std::vector<Vec2>& points) {
    std::sort(points.begin(), points.end(),
              [](const Vec2& a, const Vec2& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
    const auto isRightTurn = [](const Vec2& a, const Vec2& b, const Vec2& c) {
        const Vec2 u = b - a, v = c - a;
        return double(u.x) * v.y - double(u.y) * v.x <= 0.0;
    };
    std::vector<Vec2> hull;
    for (int side = 0; side < 2; ++side) {
        const size_t first = hull.size();
        for (const Vec2& p : points) {
            while (hull.size() >= first + 2 && isRightTurn(hull[hull.size() - 2], hull.back(), p))
                hull.pop_back();
            hull.push_back(p);
        }
        hull.pop_back();  // the other side begins with it
        std::reverse(points.begin(), points.end());
    }
    return hull;
}

// The line that takes away most, if that is worth it: its number.
size_t bestLine(const std::vector<Vec2>& corners, const std::vector<Vec3>& lines) {
    std::vector<Vec2> kept;
    double least = (1.0 - kLeastShare) * areaOf(corners);
    size_t best = lines.size();
    for (size_t i = 0; i < lines.size(); ++i) {
        clip(corners, Vec2(lines[i]), lines[i].z, kept);
        const double area = areaOf(kept);
        if (area < least) least = area, best = i;
    }
    return best;
}

// Greedily, then each once more beside the others: the first may have been a compromise.
std::vector<Vec3> chooseLines(const std::vector<Vec2>& corners, const std::vector<Vec3>& lines,
                              size_t most) {
    std::vector<Vec3> chosen;
    std::vector<Vec2> left, kept;
    const auto chooseBeside = [&](size_t but) {
        left = corners;
        for (size_t i = 0; i < chosen.size(); ++i) {
            if (i == but) continue;
            clip(left, Vec2(chosen[i]), chosen[i].z, kept);
            left.swap(kept);
        }
        return bestLine(left, lines);
    };
    while (chosen.size() < most) {
        const size_t best = chooseBeside(chosen.size());
        if (best == lines.size()) break;
        chosen.push_back(lines[best]);
    }
    constexpr int kRounds = 2;
    for (int round = 0; round < kRounds; ++round) {
        for (size_t i = 0; i < chosen.size(); ++i) {
            const size_t best = chooseBeside(i);
            if (best < lines.size()) chosen[i] = lines[best];
        }
    }
    return chosen;
}

}  // namespace

float drawnReach(const Splat& splat) { return (splat.long_radius + splat.gap) * kCorner; }

void cutAtBorders(const PointIndex& index, Splat& splat) {
    const float a = drawnReach(splat), b = (splat.short_radius + splat.gap) * kCorner;
    const Vec3 across = splat.across();
    std::vector<Vec2> within;
    index.forEachWithin(splat.center, a, [&](const PointIndex::Item& item) {
        const Vec3 d = item.position - splat.center;
        const Vec2 p(glm::dot(d, splat.along), glm::dot(d, across)), u(p.x / a, p.y / b);
        if (glm::dot(u, u) <= 1.0f) within.push_back(p);
    });
    within.push_back(Vec2(0));
    const std::vector<Vec2> hull = hullOf(within);
    // Lines beyond the hull's sides: (x, y, end).
    std::vector<Vec3> lines;
    for (size_t i = 0; i < hull.size() && hull.size() > 2; ++i) {
        const Vec2 side = hull[(i + 1) % hull.size()] - hull[i];
        const float length = glm::length(side);
        if (!(length > 0.0f)) continue;
        const Vec2 to = Vec2(side.y, -side.x) / length;
        lines.emplace_back(to, std::max(glm::dot(to, hull[i]), 0.0f) + kBorderGap * splat.gap);
    }
    constexpr int kCorners = 32;
    std::vector<Vec2> corners;
    for (int k = 0; k < kCorners; ++k) {
        const float angle = 2.0f * float(kPi) * float(k) / float(kCorners);
        corners.emplace_back(a * std::cos(angle), b * std::sin(angle));
    }
    // What creases cut off is gone already.
    std::vector<Vec2> kept;
    for (int c = 0; c < splat.n_cuts; ++c) {
        clip(corners, Vec2(splat.cuts[size_t(c)]), splat.cuts[size_t(c)].z, kept);
        corners.swap(kept);
    }
    for (const Vec3& line : chooseLines(corners, lines, size_t(kMostDiscCuts - splat.n_cuts)))
        splat.cuts[size_t(splat.n_cuts++)] = line;
}

}  // namespace stipple
