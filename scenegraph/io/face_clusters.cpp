// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/face_clusters.h>

#include <core/error.h>
#include <scenegraph/io/edges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <queue>

namespace stipple {

namespace {

constexpr double kTurnWeight = 10.0;  // of (1 - cosine)^2: a whole turn of 45 degrees costs 1
constexpr double kFitWeight = 20.0;   // of the mean squared distance over the area
constexpr double kSizeWeight = 0.25;  // phase two: for a cluster of the largest size
constexpr uint32_t kNone = 0xffffffffu;

// What is summed over a cluster's triangles: moments of the vertices, of the normals, size.
struct Sums {
    double count = 0.0;
    DVec3 v = DVec3(0.0);
    double vv[6] = {};     // xx, xy, xz, yy, yz, zz
    DVec3 n = DVec3(0.0);  // area-weighted normals
    double nn[6] = {};
    double area = 0.0, perimeter = 0.0;
    uint32_t triangles = 0;

    void addOuter(double* m, const DVec3& a, double w) {
        m[0] += w * a.x * a.x, m[1] += w * a.x * a.y, m[2] += w * a.x * a.z;
        m[3] += w * a.y * a.y, m[4] += w * a.y * a.z, m[5] += w * a.z * a.z;
    }
    Sums operator+(const Sums& o) const {
        Sums s = *this;
        s.count += o.count, s.v += o.v, s.n += o.n;
        s.area += o.area, s.perimeter += o.perimeter, s.triangles += o.triangles;
        for (int k = 0; k < 6; ++k) s.vv[k] += o.vv[k], s.nn[k] += o.nn[k];
        return s;
    }
    // Perimeter squared over that of a circle of this area, at least 1.
    double irregularity() const {
        return perimeter * perimeter / (4.0 * kPi * std::max(area, 1e-30));
    }
};

// Unit normal of the plane that fits the vertices best, towards the faces' front; fit: mean squared
// distance from it.
DVec3 planeOf(const Sums& s, double& fit) {
    const DVec3 mean = s.v / s.count;
    Eigen::Matrix3d m;
    m << s.vv[0], s.vv[1], s.vv[2], s.vv[1], s.vv[3], s.vv[4], s.vv[2], s.vv[4], s.vv[5];
    const Eigen::Vector3d e(mean.x, mean.y, mean.z);
    m = m / s.count - e * e.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(m);
    fit = std::max(0.0, solver.eigenvalues()[0]);
    const Eigen::Vector3d v = solver.eigenvectors().col(0);
    DVec3 normal(v.x(), v.y(), v.z());
    if (!(glm::dot(normal, normal) > 0.5)) normal = DVec3(0.0, 0.0, 1.0);
    return glm::dot(normal, s.n) < 0.0 ? -normal : normal;
}

// Mean of (1 - n . n_i)^2 over the faces, by area.
double turnOf(const Sums& s, const DVec3& n) {
    if (!(s.area > 0.0)) return 0.0;
    const double* m = s.nn;
    const double squares = n.x * n.x * m[0] + n.y * n.y * m[3] + n.z * n.z * m[5] +
                           2.0 * (n.x * n.y * m[1] + n.x * n.z * m[2] + n.y * n.z * m[4]);
    return std::max(0.0, 1.0 - 2.0 * glm::dot(n, s.n) / s.area + squares / s.area);
}

class Clusterer {
public:
    Clusterer(const Mesh& mesh, const ClusterOptions& options, const CancelFlag& cancel)
        : options_(options), cancel_(cancel) {
        Box3 box;
        for (const Vec3& p : mesh.positions) box.extend(p);
        const Vec3 extent = box.isEmpty() ? Vec3(1.0f) : box.extent();
        const double scale = 1.0 / double(std::max({extent.x, extent.y, extent.z, 1e-30f}));
        const size_t n = mesh.triangles.size();
        sums_.resize(n);
        parent_.resize(n);
        neighbours_.resize(n);
        for (uint32_t t = 0; t < n; ++t) {
            parent_[t] = t;
            Sums& s = sums_[t];
            DVec3 p[3];
            for (int k = 0; k < 3; ++k) {
                p[k] = (DVec3(mesh.positions[mesh.triangles[t][k]]) - DVec3(box.min)) * scale;
                s.v += p[k];
                s.addOuter(s.vv, p[k], 1.0);
            }
            s.count = 3.0;
            s.triangles = 1;
            const DVec3 cross = glm::cross(p[1] - p[0], p[2] - p[0]);
            const double twice = glm::length(cross);
            s.area = 0.5 * twice;
            if (twice > 0.0) {
                s.n = 0.5 * cross;
                s.addOuter(s.nn, cross / twice, s.area);
            }
            for (int k = 0; k < 3; ++k) s.perimeter += glm::length(p[(k + 1) % 3] - p[k]);
        }
        for (const SharedEdge& e : sharedEdges(mesh)) {
            if (e.b == kNoTriangle) continue;
            if (mesh.triangle_material[e.a] != mesh.triangle_material[e.b]) continue;
            connect(e.a, e.b, double(e.length) * scale);
        }
        left_ = uint32_t(n);
        is_flat_.assign(n, 1);
    }

    FaceClusters run() {
        FaceClusters result;
        mergeAll(true);
        result.first_of = number([&](uint32_t root) {
            double fit;
            result.first_normal.push_back(Vec3(planeOf(sums_[root], fit)));
        });
        flat_triangles_ = sums_.size();
        mergeAll(false);
        result.cluster_of =
            number([&](uint32_t root) { result.is_flat.push_back(is_flat_[root]); });
        return result;
    }

private:
    struct Neighbour {
        uint32_t to;
        double length;  // of the border between both
    };
    struct Candidate {
        double cost;
        uint32_t a, b;
        uint32_t version_a, version_b;              // triangles in each when it was made
        bool operator<(const Candidate& o) const {  // of a heap: the cheapest last
            if (cost != o.cost) return cost > o.cost;
            return a != o.a ? a > o.a : b > o.b;
        }
    };

    // The cluster of each triangle, in the order of their first; each: called once a cluster.
    template <class Each>
    std::vector<uint32_t> number(const Each& each) {
        std::vector<uint32_t> of_root(sums_.size(), kNone), result;
        uint32_t next = 0;
        for (uint32_t t = 0; t < sums_.size(); ++t) {
            const uint32_t root = find(t);
            if (of_root[root] == kNone) of_root[root] = next++, each(root);
            result.push_back(of_root[root]);
        }
        return result;
    }

    uint32_t find(uint32_t t) {
        while (parent_[t] != t) t = parent_[t] = parent_[parent_[t]];
        return t;
    }

    void connect(uint32_t a, uint32_t b, double length) {
        if (a == b) return;
        for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
            std::vector<Neighbour>& list = neighbours_[from];
            const auto found = std::find_if(list.begin(), list.end(),
                                            [&](const Neighbour& n) { return n.to == to; });
            found == list.end() ? list.push_back({to, length}) : void(found->length += length);
        }
    }

    Sums joined(uint32_t a, uint32_t b, double border) const {
        Sums s = sums_[a] + sums_[b];
        s.perimeter = std::max(s.perimeter - 2.0 * border, 0.0);
        return s;
    }

    double costOf(uint32_t a, uint32_t b, double border, bool is_first) const {
        const Sums s = joined(a, b, border);
        const double shape = 1.0 - std::max(sums_[a].irregularity(), sums_[b].irregularity()) /
                                       std::max(s.irregularity(), 1e-12);
        if (!is_first) {
            const double size = double(s.triangles) / double(options_.largest);
            return shape + kSizeWeight * size;
        }
        double fit;
        const DVec3 n = planeOf(s, fit);
        return kFitWeight * fit / std::max(s.area, 1e-30) + kTurnWeight * turnOf(s, n) + shape;
    }

    void push(uint32_t a, const Neighbour& n, bool is_first) {
        if (sums_[a].triangles + sums_[n.to].triangles > options_.largest) return;
        queue_.push({costOf(a, n.to, n.length, is_first), std::min(a, n.to), std::max(a, n.to),
                     sums_[std::min(a, n.to)].triangles, sums_[std::max(a, n.to)].triangles});
    }

    // Joins the cheapest pairs until the phase ends.
    void mergeAll(bool is_first) {
        queue_ = {};
        for (uint32_t a = 0; a < sums_.size(); ++a) {
            if (parent_[a] != a) continue;
            for (const Neighbour& n : neighbours_[a]) {
                if (a < n.to) push(a, n, is_first);
            }
        }
        const bool by_count = is_first && options_.clusters > 0;
        const double most = is_first ? options_.phase_one : options_.phase_two;
        size_t steps = 0;
        while (!queue_.empty()) {
            if (++steps % 4096 == 0 && cancel_.requested)
                throw Error(ErrorCode::kCancelled, "", "cancelled");
            if (by_count && left_ <= uint32_t(options_.clusters)) break;
            if (!is_first && double(flat_triangles_) <= options_.flat_share * double(sums_.size()))
                break;
            const Candidate c = queue_.top();
            queue_.pop();
            if (!by_count && c.cost > most) break;
            const bool is_stale = parent_[c.a] != c.a || parent_[c.b] != c.b ||
                                  sums_[c.a].triangles != c.version_a ||
                                  sums_[c.b].triangles != c.version_b;
            if (!is_stale) merge(c.a, c.b, is_first);
        }
    }

    void merge(uint32_t a, uint32_t b, bool is_first) {
        const auto border = std::find_if(neighbours_[a].begin(), neighbours_[a].end(),
                                         [&](const Neighbour& n) { return n.to == b; });
        sums_[a] = joined(a, b, border->length);
        if (!is_first) {
            for (const uint32_t part : {a, b}) {
                // sums_[a] holds both by now.
                const uint32_t n =
                    part == a ? sums_[a].triangles - sums_[b].triangles : sums_[b].triangles;
                if (is_flat_[part]) flat_triangles_ -= n;
            }
            is_flat_[a] = 0;
        }
        parent_[b] = a;
        --left_;
        neighbours_[a].erase(border);
        for (const Neighbour& n : neighbours_[b]) {
            if (n.to == a) continue;
            auto& list = neighbours_[n.to];
            list.erase(std::find_if(list.begin(), list.end(),
                                    [&](const Neighbour& back) { return back.to == b; }));
            connect(a, n.to, n.length);
        }
        neighbours_[b] = std::vector<Neighbour>();  // {} would keep the memory
        for (const Neighbour& n : neighbours_[a]) push(a, n, is_first);
    }

    const ClusterOptions& options_;
    const CancelFlag& cancel_;
    std::vector<Sums> sums_;  // of a cluster, at its first triangle
    std::vector<uint32_t> parent_;
    std::vector<uint8_t> is_flat_;
    std::vector<std::vector<Neighbour>> neighbours_;
    std::priority_queue<Candidate> queue_;
    uint32_t left_ = 0;
    size_t flat_triangles_ = 0;
};

}  // namespace

FaceClusters clusterFaces(const Mesh& mesh, const ClusterOptions& options,
                          const CancelFlag& cancel) {
    return Clusterer(mesh, options, cancel).run();
}

}  // namespace stipple
