// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/point_discs.h>

#include <core/rng.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <bit>
#include <nanoflann.hpp>

namespace stipple {

namespace {

constexpr size_t kRadiusNeighbours = 6, kNormalNeighbours = 12;
constexpr size_t kChunk = 4096;
constexpr double kBytesPerPoint = 4.0 * kBytesPerVertex + 2.0 * kBytesPerTriangle + 76.0;

struct Cloud {
    std::vector<Vec3> points;  // relative to the first, in units of about the cloud's size

    size_t kdtree_get_point_count() const { return points.size(); }
    float kdtree_get_pt(size_t i, size_t axis) const { return points[i][int(axis)]; }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
        return false;
    }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud,
                                                 3, uint32_t>;

// The direction in which the points vary least.
Vec3 leastVariance(const Cloud& cloud, const uint32_t* indices, size_t count) {
    DVec3 mean(0.0);
    for (size_t i = 0; i < count; ++i) mean += DVec3(cloud.points[indices[i]]);
    mean /= double(count);
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < count; ++i) {
        const DVec3 d = DVec3(cloud.points[indices[i]]) - mean;
        const Eigen::Vector3d e(d.x, d.y, d.z);
        covariance += e * e.transpose();
    }
    const double scale = covariance.trace();
    if (!(scale > 0.0)) return Vec3(0, 1, 0);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(covariance / scale);
    const Eigen::Vector3d n = solver.eigenvectors().col(0);
    const Vec3 normal(float(n.x()), float(n.y()), float(n.z()));
    const float length = glm::length(normal);
    return length > 0.5f && length < 2.0f ? normal / length : Vec3(0, 1, 0);
}

bool isNull(const Vec3& v) {
    const float length = glm::dot(v, v);
    return !(length > 1e-20f && length < 1e20f);
}

// Points to be found by their place.
class PlaceTable {
public:
    explicit PlaceTable(const std::vector<Vec3>& positions)
        : positions_(positions), slots_(std::bit_ceil(2 * positions.size() + 1), kFree) {}

    // False if another has been added that lies at the very same place.
    bool add(uint32_t point) {
        const Vec3 p = positions_[point] + 0.0f;  // no -0
        const auto bits = [](float v) { return uint64_t(std::bit_cast<uint32_t>(v)); };
        const size_t mask = slots_.size() - 1;
        size_t slot = hashCombine(bits(p.x), bits(p.y) << 32 | bits(p.z)) & mask;
        for (; slots_[slot] != kFree; slot = (slot + 1) & mask) {
            if (positions_[slots_[slot]] == p) return false;
        }
        slots_[slot] = point;
        return true;
    }

private:
    static constexpr uint32_t kFree = 0xffffffffu;
    const std::vector<Vec3>& positions_;
    std::vector<uint32_t> slots_;
};

// Those to make discs of, in order.
std::vector<uint32_t> pointsToShow(const std::vector<Vec3>& positions, LoadContext& context,
                                   const std::string& where) {
    std::vector<uint32_t> points;
    PlaceTable table(positions);
    size_t n_lost = 0, n_same = 0;
    for (size_t i = 0; i < positions.size(); ++i) {
        constexpr double kMostCoordinate = 1e15;  // areas stay finite
        const DVec3 p(positions[i]);
        if (!isFinite(p) ||
            std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > kMostCoordinate) {
            ++n_lost;
        } else if (!table.add(uint32_t(i))) {
            ++n_same;
        } else {
            points.push_back(uint32_t(i));
        }
    }
    if (n_lost > 0) {
        context.warnOnce(where,
                         std::to_string(n_lost) + " points are left out: they are not finite");
    }
    if (n_same > 0) {
        context.warnOnce(where, std::to_string(n_same) +
                                    " points are left out: others lie at the very same places; the "
                                    "first of each is kept");
    }
    return points;
}

}  // namespace

PointDiscs makePointDiscs(const std::vector<Vec3>& positions, const std::vector<Vec3>& normals,
                          LoadContext& context, const std::string& where) {
    PointDiscs discs;
    context.budget.take(double(positions.size()) * kBytesPerPoint, where,
                        std::to_string(positions.size()) + " points");
    if (positions.size() >= size_t(1) << 30)
        throw Error(ErrorCode::kUnsupported, where, "more than 2^30 points");
    discs.point = pointsToShow(positions, context, where);
    DBox3 bounds;
    for (const uint32_t i : discs.point) bounds.extend(DVec3(positions[i]));
    const size_t n = discs.point.size();
    if (n == 0) return discs;

    const DVec3 extent = bounds.extent();
    const double size = std::max({extent.x, extent.y, extent.z}), unit = size > 0.0 ? size : 1.0;
    Cloud cloud;
    cloud.points.reserve(n);
    for (const uint32_t i : discs.point)
        cloud.points.emplace_back((DVec3(positions[i]) - bounds.min) / unit);
    context.throwIfCancelled();
    const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));

    std::vector<float> radii(n, 0.0f);
    std::vector<Vec3> facing(n);
    const auto measure = [&](size_t chunk, int) {
        context.throwIfCancelled();
        std::array<uint32_t, kNormalNeighbours + 1> found{};
        std::array<float, kNormalNeighbours + 1> squared{};
        for (size_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i) {
            const Vec3 given = normals.empty() ? Vec3(0.0f) : normals[discs.point[i]];
            const bool is_given = !isNull(given);
            const size_t wanted = 1 + (is_given ? kRadiusNeighbours : kNormalNeighbours);
            const size_t count =
                tree.knnSearch(&cloud.points[i].x, wanted, found.data(), squared.data());
            // The point itself is among them, at distance 0.
            const size_t near = std::min(count, kRadiusNeighbours + 1);
            for (size_t k = 1; k < near; ++k) radii[i] += std::sqrt(squared[k]) / float(near - 1);
            facing[i] =
                is_given ? glm::normalize(given) : leastVariance(cloud, found.data(), count);
        }
    };
    const size_t n_chunks = (n + kChunk - 1) / kChunk;
    if (context.pool) {
        context.pool->forEach(n_chunks, measure);
    } else {
        for (size_t c = 0; c < n_chunks; ++c) measure(c, 0);
    }

    std::vector<float> sorted = radii;
    std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(n / 2), sorted.end());
    // A single point, or all at one place: something that can be seen.
    const float median = sorted[n / 2] > 0.0f ? sorted[n / 2] : 0.01f;
    discs.corners.reserve(n * 4);
    discs.triangles.reserve(n * 2);
    for (size_t i = 0; i < n; ++i) {
        const double radius = double(std::clamp(radii[i], 0.1f * median, 4.0f * median)) * unit;
        // Half the diagonal of the square of the disc's area; turned at random, so that rows of
        // points show no pattern.
        const double reach = radius * std::sqrt(kPi / 2.0);
        const double angle = 2.0 * kPi * double(uniformFloat(hashCombine(discs.point[i], 17)));
        const DVec3 normal(facing[i]);
        const DVec3 other = std::abs(normal.x) < 0.7 ? DVec3(1, 0, 0) : DVec3(0, 1, 0);
        const DVec3 a = glm::normalize(glm::cross(normal, other)), b = glm::cross(normal, a);
        const DVec3 u = (a * std::cos(angle) + b * std::sin(angle)) * reach,
                    v = (b * std::cos(angle) - a * std::sin(angle)) * reach;
        const DVec3 center(positions[discs.point[i]]);
        const uint32_t first = uint32_t(discs.corners.size());
        for (const DVec3& offset : {u, v, -u, -v}) discs.corners.emplace_back(center + offset);
        discs.triangles.emplace_back(first, first + 1, first + 2);
        discs.triangles.emplace_back(first, first + 2, first + 3);
    }
    return discs;
}

}  // namespace stipple
