// SPDX-License-Identifier: Apache-2.0
#include <sampling/tile_cut.h>

#include <core/rng.h>
#include <sampling/node_class.h>
#include <sampling/patch_choice.h>
#include <sampling/point_attributes.h>
#include <scenegraph/object_id.h>

#include <algorithm>
#include <tuple>

namespace stipple {

TileCut::TileCut(const Scene& scene, const View& view, const RenderSettings& settings,
                 const FramePlan& plan, PointLists& lists)
    : context_{scene, view, settings, lists, nullptr, {}, {}},
      plan_(plan),
      points_(context_),
      group_points_(context_, points_),
      triangles_(context_),
      surfels_(context_) {}

void TileCut::emit(const Batch& batch, PointSink& sink) {
    const PlannedNode& planned = plan_.nodes[batch.index];
    const Affine& camera_from_child = planned.camera_from_child;
    context_.sink = &sink;
    const BoxProjection box =
        projectBox(context_.view, camera_from_child.linear, camera_from_child.translation,
                   nodeBounds(context_.scene, planned.child, planned.node));
    if (planned.child.isGroup()) {
        drawGroupNode(planned.child, planned.node, camera_from_child, planned.path, box);
    } else {
        drawMesh(planned.child.index(), planned.node, camera_from_child, planned.path, box);
    }
    points_.flush();
}

void TileCut::attributes(uint32_t number, float sub_x, float sub_y, SurfaceSample& sample) const {
    const Run& run = context_.runOf(number);
    if (run.surfel_level >= 0) {
        const uint32_t place = (number % kBlockPoints) >> run.numbers_per_surfel_shift;
        surfelAttributes(context_, run, run.first_index + place, sample);
        return;
    }
    const uint32_t index = run.first_index + number % kBlockPoints;
    if (run.frame != kNoFrame) {
        triangleAttributes(context_.scene, context_.view, context_.frames[run.frame],
                           run.child.index(), index, sub_x, sub_y, sample);
        return;
    }
    if (run.block) {
        pointAttributes(context_.scene, context_.view, run, *run.block, int(index % kBlockPoints),
                        sub_x, sub_y, sample);
        return;
    }
    int lane;
    ListBlock scratch;
    const ListBlock& list =
        context_.lists.points({run.child, run.node, run.direction}, index, 1, 0, scratch, lane);
    pointAttributes(context_.scene, context_.view, run, list, lane, sub_x, sub_y, sample);
}

void TileCut::prefetch(uint32_t number) const {
    const Run& run = context_.runOf(number);
    if (run.block) prefetchAttributes(*run.block, (run.first_index + number) % kBlockPoints);
}

void TileCut::forget() {
    context_.runs.clear();
    context_.frames.clear();
    points_.flush();
}

void TileCut::collect(const Affine& camera_from_child, const Box3& bounds, uint32_t index,
                      bool is_instance) {
    const BoxProjection box =
        projectBox(context_.view, camera_from_child.linear, camera_from_child.translation, bounds);
    if (box.is_visible && box.rect.overlaps(context_.sink->region()))
        opened_.push_back({box, index, is_instance});
}

void TileCut::sortCollected(size_t begin) {
    std::sort(opened_.begin() + ptrdiff_t(begin), opened_.end(),
              [](const Opened& a, const Opened& b) {
                  return std::tie(a.box.z_min, a.is_instance, a.index) <
                         std::tie(b.box.z_min, b.is_instance, b.index);
              });
}

// A node of a group: points, if all of it is far enough, else what it opens to.
void TileCut::drawGroupNode(ChildRef ref, uint32_t node_index, const Affine& camera_from_group,
                            uint64_t path, const BoxProjection& box) {
    const Scene& scene = context_.scene;
    const Group& group = scene.groups[ref.index()];
    const GroupNode& node = group.nodes[node_index];
    if (!box.is_visible || !(node.area > 0.0) || !box.rect.overlaps(context_.sink->region()) ||
        drawAsPoints(ref, node_index, camera_from_group, path, box) || isHidden(box))
        return;
    const size_t begin = opened_.size();
    for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
        const ChildRef child = group.instances.child(i);
        collect(camera_from_group * group.instances.groupFromChild(i),
                child.isGroup() ? nodeBounds(scene.groups[child.index()], 0)
                                : scene.meshes[child.index()].bounds,
                i, true);
    }
    for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c)
        collect(camera_from_group, nodeBounds(group, c), c, false);
    sortCollected(begin);
    const size_t end = opened_.size();
    for (size_t k = begin; k < end; ++k) {
        const Opened o = opened_[k];
        if (!o.is_instance) {
            drawGroupNode(ref, o.index, camera_from_group, path, o.box);
            continue;
        }
        const ChildRef child = group.instances.child(o.index);
        if (!child.isGroup() && isHidden(o.box)) continue;
        const Affine camera_from_child =
            camera_from_group * group.instances.groupFromChild(o.index);
        const uint64_t child_path = extendObjectPath(path, group.listed_index[o.index]);
        if (child.isGroup()) {
            drawGroupNode(child, 0, camera_from_child, child_path, o.box);
        } else {
            drawMesh(child.index(), 0, camera_from_child, child_path, o.box);
        }
    }
    opened_.resize(begin);
}

// False if the node must be opened.
bool TileCut::drawAsPoints(ChildRef ref, uint32_t node_index, const Affine& camera_from_group,
                           uint64_t path, const BoxProjection& box) {
    const RenderSettings& settings = context_.settings;
    const GroupNode& node = context_.scene.groups[ref.index()].nodes[node_index];
    if (node.count <= 1 || box.depth_ratio > settings.cut_ratio) return false;
    const double bound = box.bound * maxAreaScale(camera_from_group.linear);
    if (node.max_triangle_area * bound > settings.area_threshold) return false;
    const double n = settings.samples * bound * node.area;
    if (box.size > kLargestGroupRun && n > kFewPoints) return false;
    const double area = double(std::max(box.size, 1.0f)) * double(std::max(box.thickness, 1.0f));
    RunDensity density;
    density.wanted = settings.samples;
    const double overdraw =
        std::min(settings.samples, 1.0) * bound * node.area / (kMostOverdraw * area);
    if (overdraw > 1.0) {
        if (box.thickness > kThinNode) return false;
        density.wanted /= overdraw;
        density.narrow = true;
    }
    density.drawn = density.wanted * bound;
    if (!context_.sink->hides(box.rect, box.z_min, density.narrow))
        group_points_.draw(ref, node_index, camera_from_group, path, density);
    return true;
}

void TileCut::drawMesh(uint32_t mesh_index, uint32_t node_index, const Affine& camera_from_object,
                       uint64_t path, const BoxProjection& box) {
    const Mesh& mesh = context_.scene.meshes[mesh_index];
    if (mesh.triangles.empty() && !mesh.surfels) return;
    if (node_index == 0 &&
        drawsPatches(mesh, box, camera_from_object.linear, context_.view, context_.settings)) {
        drawPatches(mesh, camera_from_object, path);
        return;
    }
    const InstanceFrame frame = makeInstanceFrame(camera_from_object, path);
    if (mesh.surfels) {
        points_.flush();
        if (surfels_.draw(mesh_index, frame, box.z_min)) return;
    }
    SeenMesh seen;
    if (node_index == 0 && box.depth_ratio <= context_.settings.cut_ratio) {
        const RunDensity density = meshDensity(frame, box, 1.0);
        seen = seeMesh(context_, frame, mesh_index, density);
        const double count = density.drawn * mesh.area;
        if (seen.hasVisible() && box.size <= float(context_.settings.visible_size) &&
            count * seen.visible_share <= double(kLongestList)) {
            addMeshPoints(context_, points_, frame, mesh_index, 0, seen, density, count);
            return;
        }
        seen.direction = ListName::kWhole;
    }
    uint32_t triangle_frame = kNoFrame;
    drawMeshNode(frame, mesh_index, seen, node_index, box, triangle_frame);
}

// What was not planned patch by patch, as it lies below a node that is a batch.
void TileCut::drawPatches(const Mesh& mesh, const Affine& camera_from_object, uint64_t path) {
    const size_t begin = opened_.size();
    for (uint32_t i = 0; i < mesh.patches.size(); ++i)
        collect(camera_from_object, mesh.patches[i].bounds, i, false);
    sortCollected(begin);
    const size_t end = opened_.size();
    const double area_scale = maxAreaScale(camera_from_object.linear);
    for (size_t k = begin; k < end; ++k) {
        const Opened o = opened_[k];
        if (isHidden(o.box)) continue;
        const uint32_t chosen = choosePatch(context_.scene, mesh.patches[o.index], o.box,
                                            area_scale, context_.view, context_.settings);
        const BoxProjection box =
            projectBox(context_.view, camera_from_object.linear, camera_from_object.translation,
                       context_.scene.meshes[chosen].nodes[0].bounds);
        if (box.is_visible) drawMesh(chosen, 0, camera_from_object, path, box);
    }
    opened_.resize(begin);
}

RunDensity TileCut::meshDensity(const InstanceFrame& frame, const BoxProjection& box,
                                double facing) const {
    RunDensity density;
    density.wanted = context_.settings.samples;
    density.drawn = density.wanted * box.bound * frame.area_scale * facing;
    return density;
}

// The cut through a mesh's octree. triangle_frame: where the instance stands in
// context.frames, once it does.
void TileCut::drawMeshNode(const InstanceFrame& frame, uint32_t mesh_index, const SeenMesh& seen,
                           uint32_t node_index, const BoxProjection& box,
                           uint32_t& triangle_frame) {
    const RenderSettings& settings = context_.settings;
    const Mesh& mesh = context_.scene.meshes[mesh_index];
    const MeshNode& node = mesh.nodes[node_index];
    const bool orthographic = context_.view.orthographic;
    const double facing =
        settings.orientation
            ? double(largestCosine(node.normals, node.bounds,
                                   orthographic ? frame.facing : frame.eye_object, orthographic))
            : 1.0;
    switch (classifyNode(mesh, node, box, frame.area_scale, facing, settings)) {
        case NodeClass::kPoints: {
            const RunDensity density = meshDensity(frame, box, facing);
            addMeshPoints(context_, points_, frame, mesh_index, node_index, seen, density,
                          std::min(density.drawn * node.area, 1e9));
            return;
        }
        case NodeClass::kTriangles:
            if (triangle_frame == kNoFrame) {
                triangle_frame = uint32_t(context_.frames.size());
                context_.frames.push_back(frame);
            }
            points_.flush();
            triangles_.add(mesh_index, node_index, triangle_frame);
            return;
        case NodeClass::kLargeTriangles:
            return;  // in the z-buffer already
        case NodeClass::kOpen:
            break;
    }
    const size_t begin = opened_.size();
    for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c)
        collect(frame.camera_from_object, mesh.nodes[c].bounds, c, false);
    sortCollected(begin);
    const size_t end = opened_.size();
    for (size_t k = begin; k < end; ++k) {
        const Opened o = opened_[k];
        if (!isHidden(o.box)) drawMeshNode(frame, mesh_index, seen, o.index, o.box, triangle_frame);
    }
    opened_.resize(begin);
}

}  // namespace stipple
