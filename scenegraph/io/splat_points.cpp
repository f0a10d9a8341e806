// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_points.h>

#include <core/error.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <queue>
#include <tuple>

namespace stipple {

size_t joinSamePlaces(SplatPoints& points) {
    constexpr size_t kMostAtOnePlace = 8;
    constexpr float kAlike = 0.9f;  // cosine
    std::vector<uint32_t> order(points.size());
    for (uint32_t i = 0; i < points.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const Vec3 &p = points[a].position, &q = points[b].position;
        return std::tie(p.x, p.y, p.z, a) < std::tie(q.x, q.y, q.z, b);
    });
    std::vector<uint8_t> goes(points.size(), 0);
    std::vector<uint32_t> kept;  // at the place
    for (const uint32_t i : order) {
        const SplatPoint& point = points[i];
        if (!kept.empty() && points[kept[0]].position != point.position) kept.clear();
        goes[i] = kept.size() == kMostAtOnePlace ||
                  std::any_of(kept.begin(), kept.end(), [&](uint32_t k) {
                      const SplatPoint& other = points[k];
                      return other.finish == point.finish &&
                             (other.normal == point.normal ||
                              glm::dot(other.normal, point.normal) > kAlike);
                  });
        if (!goes[i]) kept.push_back(i);
    }
    size_t to = 0;
    for (size_t i = 0; i < points.size(); ++i) {
        if (!goes[i]) points[to++] = points[i];
    }
    const size_t n_gone = points.size() - to;
    points.resize(to);
    return n_gone;
}

void fitPlane(SplatPoints& points, const PointIndex& index, int neighbours, uint32_t i,
              std::vector<NearPoint>& near) {
    SplatPoint& point = points[i];
    index.nearest(point.position, size_t(neighbours) + 1, near);
    constexpr size_t kClose = 6;
    const size_t n_close = std::min(near.size(), kClose + 1) - 1;
    point.spacing = 0.0f;
    for (size_t k = 1; k <= n_close; ++k)
        point.spacing += std::sqrt(near[k].squared) / float(n_close);
    DVec3 mean(0.0);
    for (const NearPoint& p : near) mean += DVec3(points[p.index].position) / double(near.size());
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const NearPoint& p : near) {
        const DVec3 d = DVec3(points[p.index].position) - mean;
        const Eigen::Vector3d e(d.x, d.y, d.z);
        covariance += e * e.transpose();
    }
    point.roughness = 1.0f / 3.0f;
    if (!(covariance.trace() > 0.0)) return;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(covariance / covariance.trace());
    const Eigen::Vector3d v = solver.eigenvectors().col(0), l = solver.eigenvalues();
    // A line or a lump of points has no plane of its own.
    if (!(l[1] > 0.02) || l[0] > 0.25 * l[1] || !(v.norm() > 0.5)) return;
    point.roughness = float(std::max(l[0], 0.0));
    const Vec3 plane(float(v.x()), float(v.y()), float(v.z()));
    // The plane of two sheets that lie close, or of an edge, is none of a surface's.
    if (!point.is_facing) point.normal = glm::dot(plane, point.normal) < 0.0f ? -plane : plane;
}

Vec3 normalBesideCrease(const SplatPoints& points, const PointIndex& index, int neighbours,
                        uint32_t i, std::vector<NearPoint>& near) {
    constexpr float kRough = 0.005f, kFlatter = 0.2f, kOnPlane = 0.2f;  // spacings
    const SplatPoint& point = points[i];
    if (point.roughness < kRough) return Vec3(0.0f);
    index.nearest(point.position, 3 * size_t(neighbours), near);
    float least = kOnPlane * point.spacing;
    Vec3 normal(0.0f);
    for (const NearPoint& p : near) {
        const SplatPoint& flat = points[p.index];
        if (flat.roughness > std::min(kFlatter * point.roughness, kRough)) continue;
        const float height = std::abs(glm::dot(point.position - flat.position, flat.normal));
        if (height >= least) continue;
        least = height;
        normal = glm::dot(flat.normal, point.normal) < 0.0f ? -flat.normal : flat.normal;
    }
    return normal;
}

namespace {

template <class Body>
void forAll(size_t n, ThreadPool& pool, const CancelFlag& cancel, const Body& body) {
    constexpr size_t kChunk = 1024;
    pool.forEach((n + kChunk - 1) / kChunk, [&](size_t chunk, int) {
        if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
        std::vector<NearPoint> near;
        for (size_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i)
            body(uint32_t(i), near);
    });
}

constexpr uint32_t kNobody = 0xffffffffu;
constexpr size_t kTurnNeighbours = 8;

// The nearest points of each, kTurnNeighbours of them, and the points that have one among theirs.
struct Neighbourhood {
    std::vector<uint32_t> near, begin, back;
};

Neighbourhood makeNeighbourhood(const SplatPoints& points, const PointIndex& index,
                                ThreadPool& pool, const CancelFlag& cancel) {
    const size_t n = points.size();
    Neighbourhood result;
    result.near.assign(n * kTurnNeighbours, kNobody);
    forAll(n, pool, cancel, [&](uint32_t i, std::vector<NearPoint>& found) {
        index.nearest(points[i].position, kTurnNeighbours + 1, found);
        size_t to = 0;
        for (size_t k = 0; k < found.size() && to < kTurnNeighbours; ++k) {
            if (found[k].index != i) result.near[i * kTurnNeighbours + to++] = found[k].index;
        }
    });
    result.begin.assign(n + 1, 0);
    for (const uint32_t to : result.near) {
        if (to != kNobody) ++result.begin[to + 1];
    }
    for (size_t i = 0; i < n; ++i) result.begin[i + 1] += result.begin[i];
    result.back.resize(result.begin[n]);
    std::vector<uint32_t> fill(result.begin.begin(), result.begin.end() - 1);
    for (size_t i = 0; i < result.near.size(); ++i) {
        if (result.near[i] != kNobody)
            result.back[fill[result.near[i]]++] = uint32_t(i / kTurnNeighbours);
    }
    return result;
}

struct TurnEdge {
    float cost;
    uint32_t from, to;
    bool operator<(const TurnEdge& o) const {
        return cost != o.cost ? cost > o.cost : to != o.to ? to > o.to : from > o.from;
    }
};

// Turns normals so that neighbours agree. If they agreed with each other before, they stay.
void orient(SplatPoints& points, const PointIndex& index, ThreadPool& pool,
            const CancelFlag& cancel) {
    const size_t n = points.size();
    if (std::all_of(points.begin(), points.end(), [](const SplatPoint& p) { return p.is_facing; }))
        return;
    const Neighbourhood around = makeNeighbourhood(points, index, pool, cancel);
    std::vector<uint32_t> by_height(n);
    for (uint32_t i = 0; i < n; ++i) by_height[i] = i;
    std::sort(by_height.begin(), by_height.end(), [&](uint32_t a, uint32_t b) {
        const float ya = points[a].position.y, yb = points[b].position.y;
        return ya != yb ? ya > yb : a < b;
    });
    std::vector<uint8_t> is_done(n, 0), is_flipped(n, 0);
    for (size_t i = 0; i < n; ++i) is_done[i] = points[i].is_facing;
    for (const uint32_t seed : by_height) {
        if (is_done[seed]) continue;
        if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
        std::vector<uint32_t> part = {seed};
        is_done[seed] = 1;
        is_flipped[seed] = points[seed].normal.y < 0.0f;
        std::priority_queue<TurnEdge> edges;
        const auto push = [&](uint32_t from) {
            const auto consider = [&](uint32_t to) {
                if (to == kNobody || is_done[to]) return;
                const float dot = glm::dot(points[from].normal, points[to].normal);
                edges.push({1.0f - std::abs(dot), from, to});
            };
            for (size_t k = 0; k < kTurnNeighbours; ++k)
                consider(around.near[from * kTurnNeighbours + k]);
            for (uint32_t k = around.begin[from]; k < around.begin[from + 1]; ++k)
                consider(around.back[k]);
        };
        push(seed);
        while (!edges.empty()) {
            const TurnEdge e = edges.top();
            edges.pop();
            if (is_done[e.to]) continue;
            is_done[e.to] = 1;
            const bool differs = glm::dot(points[e.from].normal, points[e.to].normal) < 0.0f;
            is_flipped[e.to] = is_flipped[e.from] != uint8_t(differs);
            part.push_back(e.to);
            push(e.to);
        }
        size_t flips = 0;
        for (const uint32_t i : part) flips += is_flipped[i];
        // Given normals agree but for a few: what most of them say holds.
        const bool are_given = flips * 20 < part.size() || flips * 20 > part.size() * 19;
        const bool turn_back = are_given && flips * 2 > part.size();
        for (const uint32_t i : part) {
            if (is_flipped[i] != uint8_t(turn_back)) points[i].normal *= -1.0f;
        }
    }
}

}  // namespace

void findNormals(SplatPoints& points, const PointIndex& index, int neighbours, ThreadPool& pool,
                 const CancelFlag& cancel) {
    const size_t n = points.size();
    forAll(n, pool, cancel, [&](uint32_t i, std::vector<NearPoint>& near) {
        fitPlane(points, index, neighbours, i, near);
    });
    // Across a crease only planes of both its sides say which way to turn.
    orient(points, index, pool, cancel);
    std::vector<Vec3> beside(n);
    forAll(n, pool, cancel, [&](uint32_t i, std::vector<NearPoint>& near) {
        beside[i] = normalBesideCrease(points, index, neighbours, i, near);
    });
    for (size_t i = 0; i < n; ++i) {
        points[i].is_at_crease = beside[i] != Vec3(0.0f);
        if (points[i].is_at_crease && !points[i].is_facing) points[i].normal = beside[i];
    }
}

}  // namespace stipple
