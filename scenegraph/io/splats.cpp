// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splats.h>

#include <core/image.h>
#include <core/option_text.h>
#include <core/rng.h>
#include <core/stopwatch.h>
#include <scenegraph/surface_at.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <map>
#include <nanoflann.hpp>
#include <queue>

namespace stipple {

void applyOption(SplatOptions& options, const std::string& key, const std::string& value) {
    if (key == "tolerance") {
        options.tolerance = numberOption(key, value, 1e-6, 100, "0.000001..100");
    } else if (key == "color_tolerance") {
        options.color_tolerance = numberOption(key, value, 0, 2, "0..2");
    } else if (key == "neighbours") {
        options.neighbours = int(numberOption(key, value, 4, 1000, "4..1000"));
    } else if (key == "points") {
        options.points = int(numberOption(key, value, 16, 1e8, "16..100000000"));
    } else if (key == "relax") {
        options.relax = switchOption(key, value);
    } else if (key == "naive") {
        options.naive = switchOption(key, value);
    } else {
        throw Error(
            ErrorCode::kInvalidArgument, "--set",
            "unknown option '" + key +
                "' of splats (tolerance, color_tolerance, neighbours, points, relax, naive)");
    }
}

namespace {

struct CloudPoint {
    Vec3 position = Vec3(0), normal = Vec3(0), color = Vec3(0);  // relative to the middle; sRGB
    uint8_t finish = 0;
};

struct Cloud {
    std::vector<CloudPoint> points;

    size_t kdtree_get_point_count() const { return points.size(); }
    float kdtree_get_pt(size_t i, size_t axis) const { return points[i].position[int(axis)]; }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
        return false;
    }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud,
                                                 3, uint32_t>;

constexpr uint32_t kNobody = 0xffffffffu;
constexpr size_t kFirstLook = 64;      // neighbours
constexpr size_t kMostCovered = 1024;  // points, about: flat places would take n^2 time

class SplatBuilder {
public:
    SplatBuilder(const Scene& scene, const SplatOptions& options, ThreadPool& pool,
                 const CancelFlag& cancel, const std::function<void(double)>& progress)
        : scene_(scene), options_(options), pool_(pool), cancel_(cancel), progress_(progress) {}

    SurfelModel build(SplatReport& report) {
        const Stopwatch watch;
        const DBox3 bounds = sceneBounds(scene_);
        middle_ = bounds.isEmpty() ? DVec3(0.0) : 0.5 * (bounds.min + bounds.max);
        gather(scene_.root, Affine(), 0);
        if (cloud_.points.empty())
            throw Error(ErrorCode::kInvalidScene, scene_.path, "has no points to make splats of");
        tolerance_ = float(0.01 * options_.tolerance * glm::length(bounds.max - bounds.min));
        tree_ = std::make_unique<Tree>(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16));
        tree_->buildIndex();
        findPlanes();
        progress_(0.3);
        orient();
        progress_(0.4);
        growRadii();
        progress_(0.6);
        choose();
        if (options_.relax && !options_.naive) relax();
        progress_(0.95);
        SurfelModel model = pack(bounds);
        report.points = cloud_.points.size();
        report.splats = splats_.size();
        report.tolerance = double(tolerance_);
        measure(report);
        report.seconds = watch.seconds();
        return model;
    }

private:
    void throwIfAsked() const {
        if (cancel_.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
    }

    // The points of all instances, in order.
    void gather(uint32_t group_index, const Affine& world_from_group, int depth) {
        const Group& group = scene_.groups[group_index];
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef child = group.instances.child(i);
            if (child.isNone()) continue;
            const Affine world_from_child = world_from_group * group.instances.groupFromChild(i);
            if (child.isGroup()) {
                if (depth < kDeepestNesting) gather(child.index(), world_from_child, depth + 1);
            } else {
                gatherMesh(scene_.meshes[child.index()], world_from_child);
            }
        }
    }

    void gatherMesh(const Mesh& mesh, const Affine& world_from_object) {
        throwIfAsked();
        if (mesh.triangles.empty()) return;
        DMat3 area_map = cofactor(world_from_object.linear);
        const double side = glm::dot(world_from_object.linear[0], area_map[0]) < 0.0 ? -1.0 : 1.0;
        const auto add = [&](const Vec3& p, const Vec3& normal, const Vec3& albedo,
                             uint16_t material) {
            CloudPoint point;
            point.position = Vec3(world_from_object.point(DVec3(p)) - middle_);
            point.normal = Vec3(glm::normalize(area_map * DVec3(normal) * side));
            for (int k = 0; k < 3; ++k)
                point.color[k] = srgbFromLinear(std::clamp(albedo[k], 0.0f, 1.0f));
            point.finish = finishOf(material);
            constexpr size_t kMostPoints = size_t(1) << 27;
            if (cloud_.points.size() >= kMostPoints)
                throw Error(ErrorCode::kUnsupported, scene_.path, "has more than 2^27 points");
            cloud_.points.push_back(point);
        };
        if (mesh.is_cloud) {
            for (size_t i = 0; i + 3 < mesh.positions.size(); i += 4) {
                const Vec3* c = &mesh.positions[i];
                const Vec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
                const Material& material = scene_.materials[mesh.triangle_material[0]];
                const Vec3 tint = mesh.colors.empty() ? Vec3(1.0f) : Vec3(mesh.colors[i]);
                if (glm::dot(normal, normal) > 0.0f)
                    add(0.25f * (c[0] + c[1] + c[2] + c[3]), normal, material.base_color * tint,
                        mesh.triangle_material[0]);
            }
            return;
        }
        // Evenly over the surface: the golden ratio along the areas and within the triangles.
        const double total = mesh.area;
        const size_t n = size_t(options_.points);
        for (size_t i = 0; i < n; ++i) {
            const double u = std::fmod((double(i) + 0.5) / double(n), 1.0) * total;
            const size_t t = size_t(std::upper_bound(mesh.cumulative_area.begin() + 1,
                                                     mesh.cumulative_area.end() - 1, u) -
                                    mesh.cumulative_area.begin()) -
                             1;
            float a = float(std::fmod(double(i) * 0.7548776662466927, 1.0)),
                  b = float(std::fmod(double(i) * 0.5698402909980532, 1.0));
            if (a + b > 1.0f) a = 1.0f - a, b = 1.0f - b;
            const UVec3& v = mesh.triangles[t];
            const Vec3 p = mesh.positions[v.x] * (1 - a - b) + mesh.positions[v.y] * a +
                           mesh.positions[v.z] * b;
            const MeshSurface surface =
                surfaceAt(mesh, scene_.materials, scene_.textures, uint32_t(t), a, b, {});
            const Vec3 flat = glm::cross(mesh.positions[v.y] - mesh.positions[v.x],
                                         mesh.positions[v.z] - mesh.positions[v.x]);
            add(p, glm::dot(flat, surface.normal_object) < 0.0f ? -flat : flat, surface.albedo,
                mesh.triangle_material[t]);
        }
    }

    uint8_t finishOf(uint16_t material) {
        const auto found = finish_of_.find(material);
        if (found != finish_of_.end()) return found->second;
        if (finishes_.size() == 256) return 255;
        SurfelFinish finish;
        finish.material = Material();
        const Material& from = scene_.materials[material];
        finish.material.name = from.name;
        finish.material.double_sided = from.double_sided;
        finish.material.metallic = from.metallic;
        finish.material.roughness = from.roughness;
        finish.material.specular = from.specular;
        finish.material.translucency = from.translucency;
        finish.material.unlit = from.unlit;
        finishes_.push_back(finish);
        return finish_of_[material] = uint8_t(finishes_.size() - 1);
    }

    template <class Body>
    void forAllPoints(const Body& body) {
        constexpr size_t kChunk = 1024;
        const size_t n = cloud_.points.size();
        pool_.forEach((n + kChunk - 1) / kChunk, [&](size_t chunk, int) {
            throwIfAsked();
            for (size_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i) body(i);
        });
    }

    // Plane of the nearest points, on the side of the normal there is; and how far apart they are.
    void findPlanes() {
        spacing_.assign(cloud_.points.size(), 0.0f);
        std::vector<Vec3> normals(cloud_.points.size());
        forAllPoints([&](size_t i) {
            std::vector<uint32_t> near(size_t(options_.neighbours) + 1);
            std::vector<float> squared(near.size());
            const size_t n = tree_->knnSearch(&cloud_.points[i].position.x, near.size(),
                                              near.data(), squared.data());
            constexpr size_t kClose = 6;
            for (size_t k = 1; k < std::min(n, kClose + 1); ++k)
                spacing_[i] += std::sqrt(squared[k]) / float(std::min(n, kClose + 1) - 1);
            DVec3 mean(0.0);
            for (size_t k = 0; k < n; ++k)
                mean += DVec3(cloud_.points[near[k]].position) / double(n);
            Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
            for (size_t k = 0; k < n; ++k) {
                const DVec3 d = DVec3(cloud_.points[near[k]].position) - mean;
                const Eigen::Vector3d e(d.x, d.y, d.z);
                covariance += e * e.transpose();
            }
            normals[i] = cloud_.points[i].normal;
            if (!(covariance.trace() > 0.0)) return;
            Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
            solver.computeDirect(covariance / covariance.trace());
            const Eigen::Vector3d v = solver.eigenvectors().col(0), l = solver.eigenvalues();
            // A line or a lump of points has no plane of its own.
            if (!(l[1] > 0.02) || l[0] > 0.25 * l[1] || !(v.norm() > 0.5)) return;
            const Vec3 plane(float(v.x()), float(v.y()), float(v.z()));
            normals[i] = glm::dot(plane, normals[i]) < 0.0f ? -plane : plane;
        });
        for (size_t i = 0; i < normals.size(); ++i) cloud_.points[i].normal = normals[i];
    }

    // Turns normals so that neighbours agree, from the top of each part down (Hoppe et al. 1992).
    // If they agreed with each other before, they stay.
    void orient() {
        const size_t n = cloud_.points.size();
        constexpr size_t kNear = 8;
        std::vector<uint32_t> near(n * kNear, kNobody);
        forAllPoints([&](size_t i) {
            uint32_t found[kNear + 1];
            float squared[kNear + 1];
            const size_t count =
                tree_->knnSearch(&cloud_.points[i].position.x, kNear + 1, found, squared);
            size_t to = 0;
            for (size_t k = 0; k < count && to < kNear; ++k) {
                if (found[k] != i) near[i * kNear + to++] = found[k];
            }
        });
        std::vector<uint32_t> by_height(n);
        for (uint32_t i = 0; i < n; ++i) by_height[i] = i;
        std::sort(by_height.begin(), by_height.end(), [&](uint32_t a, uint32_t b) {
            const float ya = cloud_.points[a].position.y, yb = cloud_.points[b].position.y;
            return ya != yb ? ya > yb : a < b;
        });
        // Edges go both ways.
        std::vector<uint32_t> begin(n + 1, 0), back;
        for (const uint32_t to : near) {
            if (to != kNobody) ++begin[to + 1];
        }
        for (size_t i = 0; i < n; ++i) begin[i + 1] += begin[i];
        back.resize(begin[n]);
        std::vector<uint32_t> fill(begin.begin(), begin.end() - 1);
        for (size_t i = 0; i < near.size(); ++i) {
            if (near[i] != kNobody) back[fill[near[i]]++] = uint32_t(i / kNear);
        }
        struct Edge {
            float cost;
            uint32_t from, to;
            bool operator<(const Edge& o) const {
                return cost != o.cost ? cost > o.cost : to != o.to ? to > o.to : from > o.from;
            }
        };
        std::vector<uint8_t> is_done(n, 0), is_flipped(n, 0);
        for (const uint32_t seed : by_height) {
            if (is_done[seed]) continue;
            throwIfAsked();
            std::vector<uint32_t> part = {seed};
            is_done[seed] = 1;
            is_flipped[seed] = cloud_.points[seed].normal.y < 0.0f;
            std::priority_queue<Edge> edges;
            const auto push = [&](uint32_t from) {
                const auto consider = [&](uint32_t to) {
                    if (to == kNobody || is_done[to]) return;
                    const float dot =
                        glm::dot(cloud_.points[from].normal, cloud_.points[to].normal);
                    edges.push({1.0f - std::abs(dot), from, to});
                };
                for (size_t k = 0; k < kNear; ++k) consider(near[from * kNear + k]);
                for (uint32_t k = begin[from]; k < begin[from + 1]; ++k) consider(back[k]);
            };
            push(seed);
            while (!edges.empty()) {
                const Edge e = edges.top();
                edges.pop();
                if (is_done[e.to]) continue;
                is_done[e.to] = 1;
                const bool differs =
                    glm::dot(cloud_.points[e.from].normal, cloud_.points[e.to].normal) < 0.0f;
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
                if (is_flipped[i] != uint8_t(turn_back)) cloud_.points[i].normal *= -1.0f;
            }
        }
    }

    // Whether a splat at `center` may stand for the point.
    bool accepts(const CloudPoint& center, const CloudPoint& p) const {
        const float height = glm::dot(p.position - center.position, center.normal);
        if (std::abs(height) > tolerance_ || glm::dot(p.normal, center.normal) < 0.2f) return false;
        const Vec3 d = glm::abs(p.color - center.color);
        return std::max({d.x, d.y, d.z}) <= float(options_.color_tolerance) &&
               p.finish == center.finish;
    }

    static float distanceInPlane(const CloudPoint& center, const CloudPoint& p) {
        const Vec3 d = p.position - center.position;
        return glm::length(d - center.normal * glm::dot(d, center.normal));
    }

    // A first look at how far each point's splat grows.
    void growRadii() {
        radius_.assign(cloud_.points.size(), 0.0f);
        is_grown_.assign(cloud_.points.size(), 1);
        forAllPoints([&](size_t i) {
            if (options_.naive) {
                radius_[i] = spacing_[i];
            } else {
                is_grown_[i] = grow(uint32_t(i), kFirstLook);
            }
        });
    }

    // A point's splat grows over its neighbours, in order of distance, until one is not accepted.
    // False if about `most` of them did not suffice to meet one.
    bool grow(uint32_t i, size_t most) {
        const CloudPoint& center = cloud_.points[i];
        std::vector<std::pair<uint32_t, float>> near;
        std::vector<std::pair<float, uint32_t>> order;
        // Twice the spacing holds a dozen points of a surface.
        for (float known = 2.0f * std::max(spacing_[i], 1e-15f);; known *= 2.0f) {
            tree_->radiusSearch(&center.position.x, known * known, near,
                                nanoflann::SearchParams(32, 0.0f, false));
            order.clear();
            for (const auto& [k, squared] : near)
                order.emplace_back(distanceInPlane(center, cloud_.points[k]), k);
            std::sort(order.begin(), order.end());
            const bool are_all = near.size() == cloud_.points.size();
            bool is_ended = are_all;
            radius_[i] = 0.0f;
            for (const auto& [distance, k] : order) {
                if (!accepts(center, cloud_.points[k])) {
                    is_ended = true;
                    break;
                }
                // Beyond what was looked at, nothing is known.
                if (distance > known - tolerance_ && !are_all) break;
                radius_[i] = distance;
            }
            if (is_ended || near.size() >= most) return is_ended;
        }
    }

    // Points that a splat covers.
    void covered(uint32_t i, std::vector<uint32_t>& out) const {
        const CloudPoint& center = cloud_.points[i];
        const float reach = std::sqrt(radius_[i] * radius_[i] + tolerance_ * tolerance_);
        std::vector<std::pair<uint32_t, float>> found;
        tree_->radiusSearch(&center.position.x, reach * reach * 1.0001f + 1e-30f, found,
                            nanoflann::SearchParams(32, 0.0f, false));
        out.clear();
        out.push_back(i);
        for (const auto& [k, squared] : found) {
            if (k != i && distanceInPlane(center, cloud_.points[k]) <= radius_[i] &&
                accepts(center, cloud_.points[k]))
                out.push_back(k);
        }
    }

    // Greedy: of the points that none covers yet, the one whose splat covers the most of them. Only
    // what may be chosen is grown to its end, or until it covers kMostCovered.
    void choose() {
        const size_t n = cloud_.points.size();
        if (options_.naive) {
            for (uint32_t i = 0; i < n; ++i) splats_.push_back(i);
            return;
        }
        struct Candidate {
            float gain;
            uint32_t index;
            bool operator<(const Candidate& o) const {
                return gain != o.gain ? gain < o.gain : index > o.index;
            }
        };
        // A bound of what each may cover: points stand for about the square of their spacing.
        std::vector<Candidate> first(n);
        for (uint32_t i = 0; i < n; ++i) {
            const float cell = std::max(spacing_[i], 1e-30f);
            first[i] = {1.0f + 8.0f * (radius_[i] / cell) * (radius_[i] / cell), i};
        }
        std::priority_queue<Candidate> queue(std::less<Candidate>(), std::move(first));
        std::vector<uint8_t> is_covered(n, 0);
        std::vector<uint32_t> points;
        size_t n_covered = 0, steps = 0;
        while (n_covered < n && !queue.empty()) {
            if (++steps % 1024 == 0) {
                throwIfAsked();
                progress_(0.6 + 0.3 * double(n_covered) / double(n));
            }
            const Candidate c = queue.top();
            queue.pop();
            if (is_covered[c.index]) continue;
            if (!is_grown_[c.index]) {
                grow(c.index, kMostCovered);
                is_grown_[c.index] = 1;
            }
            covered(c.index, points);
            size_t gain = 0;
            for (const uint32_t k : points) gain += !is_covered[k];
            if (gain == 0) continue;
            if (!queue.empty() && float(gain) < queue.top().gain && float(gain) < c.gain) {
                queue.push({float(gain), c.index});
                continue;
            }
            for (const uint32_t k : points) {
                n_covered += !is_covered[k];
                is_covered[k] = 1;
            }
            splats_.push_back(c.index);
        }
    }

    // Splats all of whose points others cover go, small ones first.
    void relax() {
        std::vector<uint16_t> count(cloud_.points.size(), 0);
        std::vector<uint32_t> points;
        for (const uint32_t s : splats_) {
            covered(s, points);
            for (const uint32_t k : points) count[k] = uint16_t(std::min(count[k] + 1, 65535));
        }
        std::vector<uint32_t> order = splats_;
        std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
            return radius_[a] != radius_[b] ? radius_[a] < radius_[b] : a < b;
        });
        std::vector<uint32_t> kept;
        for (const uint32_t s : order) {
            throwIfAsked();
            covered(s, points);
            const bool is_needed = std::any_of(points.begin(), points.end(),
                                               [&](uint32_t k) { return count[k] <= 1; });
            if (is_needed) {
                kept.push_back(s);
                continue;
            }
            for (const uint32_t k : points) --count[k];
        }
        std::sort(kept.begin(), kept.end());
        splats_ = std::move(kept);
    }

    // Covering the points does not yet close the surface between them: no place of it is farther
    // from a point than about this many spacings.
    float drawnRadius(uint32_t i) const {
        constexpr float kGap = 0.8f;
        return radius_[i] + kGap * spacing_[i];
    }

    SurfelModel pack(const DBox3& bounds) {
        // A square of this many radii a side stands for the disc; surfels' sides are 1.25 spacings.
        constexpr float kSidePerRadius = 1.8f / 1.25f;
        std::vector<float> sides;
        for (const uint32_t i : splats_) sides.push_back(drawnRadius(i) * kSidePerRadius);
        std::vector<float> sorted = sides;
        std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(sorted.size() / 2),
                         sorted.end());
        const float spacing = std::max(sorted[sorted.size() / 2], 1e-20f);
        std::vector<Surfel> surfels;
        double area = 0.0;
        for (size_t i = 0; i < cloud_.points.size(); ++i)
            area += kPi * double(spacing_[i]) * double(spacing_[i]) * 0.25;
        for (size_t s = 0; s < splats_.size(); ++s) {
            const CloudPoint& p = cloud_.points[splats_[s]];
            const Vec3 albedo(linearFromSrgb(p.color.x), linearFromSrgb(p.color.y),
                              linearFromSrgb(p.color.z));
            surfels.push_back({p.position, p.normal, albedo, p.finish, sides[s] / spacing});
        }
        SurfelModel model;
        model.kind = "splats";
        model.bounds = enclosingFloatBox(bounds);
        model.area = area;
        // One surface, whose holes may be closed.
        for (SurfelFinish& finish : finishes_)
            finish.patch_width = float(glm::length(bounds.max - bounds.min));
        model.finishes = finishes_;
        SurfelLevel level = packSurfels(std::move(surfels), finishes_, spacing, true);
        for (SurfelBlock& block : level.blocks) {
            block.bounds.min += Vec3(middle_);
            block.bounds.max += Vec3(middle_);
            block.cone_apex += Vec3(middle_);
        }
        model.levels.push_back(std::move(level));
        return model;
    }

    // How far points are from the nearest of the splats that cover them.
    void measure(SplatReport& report) const {
        std::vector<float> distance(cloud_.points.size(), kInfinity);
        std::vector<uint32_t> points;
        for (const uint32_t s : splats_) {
            covered(s, points);
            for (const uint32_t k : points) {
                const float d =
                    std::abs(glm::dot(cloud_.points[k].position - cloud_.points[s].position,
                                      cloud_.points[s].normal));
                distance[k] = std::min(distance[k], d);
            }
        }
        for (const float d : distance) {
            report.largest_distance = std::max(report.largest_distance, double(d));
            report.mean_distance += double(d) / double(distance.size());
        }
    }

    const Scene& scene_;
    const SplatOptions& options_;
    ThreadPool& pool_;
    const CancelFlag& cancel_;
    const std::function<void(double)>& progress_;
    DVec3 middle_ = DVec3(0.0);
    Cloud cloud_;
    std::unique_ptr<Tree> tree_;
    std::vector<SurfelFinish> finishes_;
    std::map<uint16_t, uint8_t> finish_of_;
    std::vector<float> spacing_;     // mean distance to the nearest points
    std::vector<uint8_t> is_grown_;  // to its end
    std::vector<float> radius_;      // over which a point's splat covers others
    std::vector<uint32_t> splats_;   // the points whose splats are kept
    float tolerance_ = 0.0f;
};

}  // namespace

SurfelModel buildSplats(const Scene& scene, const SplatOptions& options, ThreadPool& pool,
                        const CancelFlag& cancel,
                        const std::function<void(double fraction)>& progress, SplatReport& report) {
    return SplatBuilder(scene, options, pool, cancel, progress).build(report);
}

}  // namespace stipple
