// SPDX-License-Identifier: Apache-2.0
#include <sampling/frame_plan.h>

#include <sampling/node_class.h>
#include <sampling/patch_choice.h>
#include <sampling/projection.h>
#include <scenegraph/object_id.h>

#include <atomic>
#include <utility>

namespace stipple {

namespace {

// Larger nodes, in subpixels, are opened: batches are sorted and hidden as a whole.
constexpr float kLargestBatch = 384.0f;

// A node of the scene graph that is still to be looked at.
struct Pending {
    Affine camera_from_child;
    ChildRef child;
    uint32_t node = 0;
    uint64_t path = 0;
};

class Planner {
public:
    Planner(const Scene& scene, const View& view, const RenderSettings& settings,
            bool rasterize_all)
        : scene_(scene), view_(view), settings_(settings), rasterize_all_(rasterize_all) {}

    FramePlan plan;

    // Plans the node, or pushes what it opens to.
    void visit(const Pending& p, std::vector<Pending>& opened) {
        p.child.isGroup() ? visitGroup(p, opened) : visitMesh(p);
    }

private:
    // Whether something below a node may be left to the z-buffer. The bound of a child may exceed
    // its parent's by a little (projectBox rounds far boxes up).
    bool mayBeLarge(double max_triangle_area, double bound) const {
        return projectedArea(max_triangle_area, bound) > 0.98 * settings_.large_triangle;
    }

    void visitGroup(const Pending& p, std::vector<Pending>& opened) {
        const Group& group = scene_.groups[p.child.index()];
        const GroupNode& node = group.nodes[p.node];
        const BoxProjection box =
            projectBox(view_, p.camera_from_child.linear, p.camera_from_child.translation,
                       nodeBounds(group, p.node));
        if (!box.is_visible || !(node.area > 0.0)) return;
        const double bound = box.bound * maxAreaScale(p.camera_from_child.linear);
        const bool has_large = rasterize_all_ || mayBeLarge(node.max_triangle_area, bound);
        if (!has_large && box.size <= kLargestBatch) {
            addBatch(p, box, node.area * bound);
            return;
        }
        for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
            opened.push_back({p.camera_from_child * group.instances.groupFromChild(i),
                              group.instances.child(i), 0,
                              extendObjectPath(p.path, group.listed_index[i])});
        }
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            opened.push_back({p.camera_from_child, p.child, c, p.path});
        }
    }

    void visitMesh(const Pending& p) {
        const Mesh& mesh = scene_.meshes[p.child.index()];
        if (mesh.triangles.empty() && !mesh.surfels) return;
        const BoxProjection box = projectBox(view_, p.camera_from_child.linear,
                                             p.camera_from_child.translation, mesh.nodes[0].bounds);
        if (!box.is_visible) return;
        const double area_scale = maxAreaScale(p.camera_from_child.linear);
        if (mesh.surfels && !rasterize_all_) {  // opens its own blocks
            addBatch(p, box, std::min(mesh.surfels->area * box.bound * area_scale, 1e9));
            return;
        }
        if (!rasterize_all_ &&
            drawsPatches(mesh, box, p.camera_from_child.linear, view_, settings_)) {
            visitPatches(p, mesh, area_scale);
            return;
        }
        if (rasterize_all_ || mayBeLarge(mesh.nodes[0].max_triangle_area, box.bound * area_scale)) {
            collectLargeTriangles(p, mesh, area_scale);
        }
        if (!rasterize_all_) addMeshBatches(p, mesh, box, area_scale);
    }

    void visitPatches(const Pending& p, const Mesh& mesh, double area_scale) {
        for (const MeshPatch& patch : mesh.patches) {
            const BoxProjection box = projectBox(view_, p.camera_from_child.linear,
                                                 p.camera_from_child.translation, patch.bounds);
            if (!box.is_visible) continue;
            const uint32_t chosen = choosePatch(scene_, patch, box, area_scale, view_, settings_);
            visitMesh({p.camera_from_child, ChildRef::mesh(chosen), 0, p.path});
        }
    }

    // Parts small enough, so that they sort among the other batches.
    void addMeshBatches(const Pending& p, const Mesh& mesh, const BoxProjection& box,
                        double area_scale) {
        const MeshNode& node = mesh.nodes[p.node];
        if (!box.is_visible) return;
        if (box.size <= kLargestBatch || node.child_count == 0) {
            addBatch(p, box, std::min(node.area * box.bound * area_scale, 1e9));
            return;
        }
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const BoxProjection child =
                projectBox(view_, p.camera_from_child.linear, p.camera_from_child.translation,
                           mesh.nodes[c].bounds);
            addMeshBatches({p.camera_from_child, p.child, c, p.path}, mesh, child, area_scale);
        }
    }

    void collectLargeTriangles(const Pending& p, const Mesh& mesh, double area_scale) {
        const uint32_t range_begin = uint32_t(plan.raster.ranges.size());
        stack_.assign(1, 0);
        while (!stack_.empty()) {
            const MeshNode& node = mesh.nodes[stack_.back()];
            stack_.pop_back();
            const BoxProjection box = projectBox(view_, p.camera_from_child.linear,
                                                 p.camera_from_child.translation, node.bounds);
            if (!box.is_visible) continue;
            if (rasterize_all_) {
                if (node.child_count == 0 || box.is_inside ||
                    node.triangle_count <= kCullTriangles) {
                    addRange(range_begin, node);
                    continue;
                }
            } else {
                if (!mayBeLarge(node.max_triangle_area, box.bound * area_scale)) continue;
                const NodeClass node_class =
                    classifyNode(mesh, node, box, area_scale, 1.0, settings_);
                if (node_class == NodeClass::kLargeTriangles) addRange(range_begin, node);
                if (node_class != NodeClass::kOpen) continue;
            }
            for (uint32_t c = node.child_count; c-- > 0;) stack_.push_back(node.first_child + c);
        }
        const uint32_t range_count = uint32_t(plan.raster.ranges.size()) - range_begin;
        if (range_count == 0) return;
        RasterDraw draw;
        draw.mesh = p.child.index();
        draw.linear = Mat3(p.camera_from_child.linear);
        draw.translation = Vec3(p.camera_from_child.translation);
        draw.range_begin = range_begin;
        draw.range_count = range_count;
        plan.raster.draws.push_back(draw);
        plan.raster_instances.push_back(
            {makeInstanceFrame(p.camera_from_child, p.path), p.child.index()});
    }

    void addBatch(const Pending& p, const BoxProjection& box, double expected_area) {
        Batch batch;
        batch.rect = box.rect;
        batch.z_min = box.z_min;
        batch.expected_points = float(expected_area * settings_.samples);
        batch.index = uint32_t(plan.batches.size());
        plan.batches.push_back(batch);
        plan.nodes.push_back({p.camera_from_child, p.child, p.node, p.path});
    }

    void addRange(uint32_t range_begin, const MeshNode& node) {
        plan.raster_triangles += node.triangle_count;
        auto& ranges = plan.raster.ranges;
        if (ranges.size() > range_begin &&
            ranges.back().first + ranges.back().count == node.first_triangle) {
            ranges.back().count += node.triangle_count;
        } else {
            ranges.push_back({node.first_triangle, node.triangle_count});
        }
    }

    const Scene& scene_;
    const View& view_;
    const RenderSettings& settings_;
    const bool rasterize_all_;
    std::vector<uint32_t> stack_;
};

// Of some 150 or, of a draw, 350 bytes.
constexpr size_t kMostParts = 10'000'000;

size_t partsOf(const FramePlan& plan) { return plan.batches.size() + plan.raster.draws.size(); }

void append(FramePlan& all, FramePlan& part) {
    const uint32_t batch_offset = uint32_t(all.batches.size());
    const uint32_t range_offset = uint32_t(all.raster.ranges.size());
    const auto addAll = [](auto& to, const auto& from) {
        to.insert(to.end(), from.begin(), from.end());
    };
    for (Batch& b : part.batches) b.index += batch_offset;
    for (RasterDraw& d : part.raster.draws) d.range_begin += range_offset;
    addAll(all.nodes, part.nodes);
    addAll(all.batches, part.batches);
    addAll(all.raster.ranges, part.raster.ranges);
    addAll(all.raster.draws, part.raster.draws);
    addAll(all.raster_instances, part.raster_instances);
    all.raster_triangles += part.raster_triangles;
    part = FramePlan();
}

// Numbers triangles so that a draw's numbers span just its own triangles.
void numberTriangles(FramePlan& plan) {
    uint64_t next = 0;
    for (RasterDraw& draw : plan.raster.draws) {
        uint32_t lowest = 0xffffffffu, highest = 0;
        for (uint32_t r = draw.range_begin; r < draw.range_begin + draw.range_count; ++r) {
            lowest = std::min(lowest, plan.raster.ranges[r].first);
            highest = std::max(highest, plan.raster.ranges[r].first + plan.raster.ranges[r].count);
        }
        draw.first_number = uint32_t(next - lowest);  // may wrap: first_number + triangle does not
        next += highest - lowest;
    }
    if (next >= 0x7fffffffull) {  // the last one would look like kNoNumber
        throw Error(ErrorCode::kUnsupported, "",
                    "more than 2^31 triangles would be rasterized in one frame");
    }
}

}  // namespace

FramePlan planFrame(const Scene& scene, const View& view, const RenderSettings& settings,
                    bool rasterize_all, ThreadPool& pool, const CancelFlag* cancel) {
    Affine camera_from_world;
    camera_from_world.linear = view.camera_from_world;
    camera_from_world.translation = -(view.camera_from_world * view.eye_world);

    // Breadth first until there is work for all threads, then each piece depth first.
    constexpr size_t kPieces = 1024;
    Planner first(scene, view, settings, rasterize_all);
    std::vector<Pending> front{{camera_from_world, ChildRef::group(scene.root), 0, 0}}, opened;
    while (!front.empty() && front.size() < kPieces) {
        opened.clear();
        for (const Pending& p : front) first.visit(p, opened);
        std::swap(front, opened);
    }
    std::vector<FramePlan> parts(front.size());
    std::atomic<size_t> planned = partsOf(first.plan);
    pool.forEach(front.size(), [&](size_t i, int) {
        Planner planner(scene, view, settings, rasterize_all);
        std::vector<Pending> stack{front[i]}, children;
        size_t counted = 0;
        for (size_t steps = 0; !stack.empty(); ++steps) {
            if (steps % 1024 == 0) {
                if (cancel && cancel->requested) return;
                const size_t parts_now = partsOf(planner.plan);
                planned += parts_now - std::exchange(counted, parts_now);
                if (planned > kMostParts) {
                    throw Error(ErrorCode::kUnsupported, "",
                                "more than " + std::to_string(kMostParts) +
                                    " things would be drawn one by one in a frame");
                }
            }
            const Pending p = stack.back();
            stack.pop_back();
            children.clear();
            planner.visit(p, children);
            stack.insert(stack.end(), children.rbegin(), children.rend());
        }
        parts[i] = std::move(planner.plan);
    });
    if (cancel && cancel->requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
    FramePlan plan = std::move(first.plan);
    for (FramePlan& part : parts) append(plan, part);
    numberTriangles(plan);
    return plan;
}

}  // namespace stipple
