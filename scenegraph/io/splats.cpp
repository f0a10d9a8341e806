// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splats.h>

#include <core/image.h>
#include <core/option_text.h>
#include <core/stopwatch.h>
#include <scenegraph/io/load_context.h>
#include <scenegraph/io/splat_bend.h>
#include <scenegraph/io/splat_border.h>
#include <scenegraph/io/splat_choice.h>
#include <scenegraph/io/splat_close.h>
#include <scenegraph/io/splat_pack.h>
#include <scenegraph/surface_at.h>
#include <scenegraph/surfel_finish.h>

#include <algorithm>
#include <cstdio>
#include <map>

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
    } else if (key == "shape") {
        if (value != "ellipses" && value != "circles") refuseOption(key, value, "ellipses|circles");
        options.are_circles = value == "circles";
    } else if (key == "cuts") {
        options.has_cuts = switchOption(key, value);
    } else if (key == "relax") {
        options.relax = switchOption(key, value);
    } else if (key == "naive") {
        options.naive = switchOption(key, value);
    } else {
        throw Error(
            ErrorCode::kInvalidArgument, "--set",
            "unknown option '" + key +
                "' of splats (tolerance, color_tolerance, neighbours, points, shape, cuts, relax, "
                "naive)");
    }
}

SplatRules rulesOf(const SplatOptions& options, double diagonal) {
    return {float(0.01 * options.tolerance * diagonal), float(options.color_tolerance),
            options.are_circles, options.has_cuts};
}

namespace {

class SplatBuilder {
public:
    SplatBuilder(const Scene& scene, const SplatOptions& options, ThreadPool& pool,
                 const CancelFlag& cancel, const BuildProgress& progress)
        : scene_(scene), options_(options), pool_(pool), cancel_(cancel), progress_(progress) {}

    SurfelModel build(SplatReport& report) {
        const Stopwatch watch;
        const DBox3 bounds = sceneBounds(scene_);
        middle_ = bounds.isEmpty() ? DVec3(0.0) : 0.5 * (bounds.min + bounds.max);
        requireFewPoints();
        progress_("points", 0.0);
        gather(scene_.root, Affine(), 0);
        makeFinishesOfPoints();
        report.same_places = joinSamePlaces(points_);
        if (points_.empty())
            throw Error(ErrorCode::kInvalidScene, scene_.path, "has no points to make splats of");
        const double diagonal = glm::length(bounds.max - bounds.min);
        const SplatRules rules = rulesOf(options_, diagonal);
        std::vector<Vec3> positions;
        for (const SplatPoint& p : points_) positions.push_back(p.position);
        PointIndex index;
        index.build(positions);
        progress_("normals", 0.0);
        findNormals(points_, index, options_.neighbours, pool_, cancel_);
        progress_("splats", 0.0);
        const std::vector<ChosenSplat> chosen =
            options_.naive ? splatEachPoint(points_)
                           : chooseSplats(points_, index, rules, options_.relax, pool_, cancel_,
                                          [&](double fraction) { progress_("splats", fraction); });
        progress_("model", 0.0);
        std::vector<Splat> splats;
        for (const ChosenSplat& s : chosen) splats.push_back(s.splat);
        if (!options_.naive) {
            if (rules.has_cuts)
                forEachSplat(splats.size(), [&](size_t k) { cutAtBorders(index, splats[k]); });
            narrowGaps(points_, index, chosen, splats, pool_, cancel_);
            forEachSplat(splats.size(),
                         [&](size_t k) { bendNormals(points_, chosen[k].covered, splats[k]); });
        }
        // One surface, whose holes may be closed.
        for (SurfelFinish& finish : finishes_) finish.patch_width = float(diagonal);
        double area = 0.0;
        for (const SplatPoint& p : points_) area += areaOf(p);
        std::vector<Surfel> kept;
        SurfelModel model =
            packSplats(splats, finishes_, middle_, enclosingFloatBox(bounds), area, &kept);
        report.points = points_.size();
        report.points_on_meshes = size_t(std::count_if(
            points_.begin(), points_.end(), [](const SplatPoint& p) { return p.is_facing; }));
        report.splats = splats.size();
        report.tolerance = double(rules.tolerance);
        measure(chosen, kept, report);
        report.seconds = watch.seconds();
        return model;
    }

private:
    template <class Visit>
    void forEachSplat(size_t n, const Visit& visit) {
        constexpr size_t kChunk = 64;
        pool_.forEach((n + kChunk - 1) / kChunk, [&](size_t chunk, int) {
            for (size_t k = chunk * kChunk; k < std::min(n, (chunk + 1) * kChunk); ++k) visit(k);
        });
    }

    void throwIfAsked() const {
        if (cancel_.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
    }

    // Before any is taken.
    void requireFewPoints() const {
        constexpr double kMostPoints = double(1 << 27), kBytesPerPoint = 350.0;
        const std::vector<double> shown = meshInstances(scene_);
        double points = 0.0;
        for (size_t m = 0; m < shown.size(); ++m) {
            const Mesh& mesh = scene_.meshes[m];
            if (!mesh.triangles.empty())
                points += shown[m] * double(mesh.is_cloud ? mesh.positions.size() / 4
                                                          : size_t(options_.points));
        }
        char text[64];
        std::snprintf(text, sizeof text, "%.4g points to make splats of", points);
        if (points > kMostPoints) {
            throw Error(ErrorCode::kUnsupported, scene_.path,
                        std::string("has ") + text + ", more than 2^27");
        }
        budgetBeside(scene_, options_.memory_limit_mb)
            .require(points * kBytesPerPoint, scene_.path, text);
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
        const auto add = [&](const Vec3& p, const Vec3& normal, const Vec3& shading_normal,
                             const Vec3& albedo, uint16_t material, SurfaceFinish finish) {
            SplatPoint point;
            point.is_facing = !mesh.is_cloud;
            point.position = Vec3(world_from_object.point(DVec3(p)) - middle_);
            const DVec3 facing = area_map * DVec3(normal) * side;
            if (!(glm::length(facing) > 0.0)) return;  // of no area in the world
            point.normal = Vec3(glm::normalize(facing));
            const DVec3 shading = area_map * DVec3(shading_normal) * side;
            if (point.is_facing && glm::length(shading) > 0.0) {
                point.shading_normal = Vec3(glm::normalize(shading));
                if (glm::dot(point.shading_normal, point.normal) < 0.0f)
                    point.shading_normal = -point.shading_normal;
            }
            for (int k = 0; k < 3; ++k)
                point.color[k] = srgbFromLinear(std::clamp(albedo[k], 0.0f, 1.0f));
            roughness_.push_back(finish.roughness);
            finish.roughness = 0.0f;
            finish_key_.push_back(finishKey(scene_.materials, material, finish));
            points_.push_back(point);
        };
        if (mesh.is_cloud) {
            // One of a disc's triangles; its corners are all alike.
            std::vector<uint32_t> triangle_of(mesh.positions.size() / 4, kNone);
            for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
                triangle_of[mesh.triangles[t].x / 4] = t;
            for (size_t i = 0; i < triangle_of.size(); ++i) {
                const uint32_t t = triangle_of[i];
                if (t == kNone) continue;
                const Vec3* c = &mesh.positions[4 * i];
                const Vec3 normal = glm::cross(c[1] - c[0], c[2] - c[0]);
                const MeshSurface surface =
                    surfaceAt(mesh, scene_.materials, scene_.textures, t, 0.3f, 0.3f, {});
                if (glm::dot(normal, normal) > 0.0f)
                    add(0.25f * (c[0] + c[1] + c[2] + c[3]), normal, normal, surface.albedo,
                        mesh.triangle_material[t], surface.finish);
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
            // Single-sided surfaces are seen from the side that their winding says.
            const bool is_turned = scene_.materials[mesh.triangle_material[t]].double_sided &&
                                   glm::dot(flat, surface.normal_object) < 0.0f;
            add(p, is_turned ? -flat : flat, surface.normal_object, surface.albedo,
                mesh.triangle_material[t], surface.finish);
        }
    }

    // One a material, but for whether its textures make it shine or metal: splats end where another
    // begins. As rough as its points are in the mean.
    void makeFinishesOfPoints() {
        std::map<uint32_t, uint8_t> index_of;
        for (const uint32_t key : finish_key_) index_of[key] = 0;
        const std::vector<float> no_width(scene_.materials.size(), 0.0f);
        finishes_ = makeFinishes(scene_.materials, no_width, index_of);
        std::vector<double> roughness(finishes_.size(), 0.0), count(finishes_.size(), 0.0);
        for (size_t i = 0; i < points_.size(); ++i) {
            const uint8_t f = points_[i].finish = index_of.at(finish_key_[i]);
            roughness[f] += double(roughness_[i]);
            count[f] += 1.0;
        }
        for (size_t f = 0; f < finishes_.size(); ++f)
            finishes_[f].material.roughness = float(roughness[f] / count[f]);
        finish_key_ = {}, roughness_ = {};
    }

    // How far points are from the nearest of the splats that cover them, as the model keeps these.
    void measure(const std::vector<ChosenSplat>& chosen, const std::vector<Surfel>& kept,
                 SplatReport& report) const {
        std::vector<float> distance(points_.size(), kInfinity);
        for (size_t s = 0; s < chosen.size(); ++s) {
            for (const uint32_t k : chosen[s].covered) {
                const float d =
                    std::abs(glm::dot(points_[k].position - kept[s].position, kept[s].normal));
                distance[k] = std::min(distance[k], d);
            }
        }
        for (const float d : distance) {
            report.largest_distance = std::max(report.largest_distance, double(d));
            report.mean_distance += double(d) / double(distance.size());
        }
    }

    static constexpr uint32_t kNone = 0xffffffffu;

    const Scene& scene_;
    const SplatOptions& options_;
    ThreadPool& pool_;
    const CancelFlag& cancel_;
    const BuildProgress& progress_;
    DVec3 middle_ = DVec3(0.0);
    SplatPoints points_;  // relative to the middle
    std::vector<SurfelFinish> finishes_;
    std::vector<uint32_t> finish_key_;  // a point, until finishes are made; and as rough as that
    std::vector<float> roughness_;
};

}  // namespace

SurfelModel buildSplats(const Scene& scene, const SplatOptions& options, ThreadPool& pool,
                        const CancelFlag& cancel, const BuildProgress& progress,
                        SplatReport& report) {
    return SplatBuilder(scene, options, pool, cancel, progress).build(report);
}

}  // namespace stipple
