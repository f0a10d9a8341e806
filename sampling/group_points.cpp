// SPDX-License-Identifier: Apache-2.0
#include <sampling/group_points.h>

#include <core/rng.h>
#include <scenegraph/object_id.h>

namespace stipple {

void GroupPoints::draw(ChildRef ref, uint32_t node_index, const Affine& camera_from_group,
                       uint64_t path, const RunDensity& density) {
    const GroupNode& node = context_.scene.groups[ref.index()].nodes[node_index];
    const uint64_t key = hashCombine(context_.settings.seed, path, ref.bits, node_index);
    const uint64_t count = roundAtRandom(density.drawn * node.area, key);
    if (count == 0) return;
    density_ = density;
    if (context_.settings.sampler == Sampler::kRandom) {
        for (uint64_t k = 0; k < count; ++k) {
            const uint64_t h = hashCombine(key, k, 1);
            drawOne(ref, node_index, camera_from_group, path, 1.0, uniformDouble(h),
                    uint32_t(mixBits(h)));
        }
    } else {
        spacing_ = node.area / double(count);
        phase_ = uniformDouble(mixBits(key));
        sweep(ref, node_index, camera_from_group, path, 0.0, 1.0);
    }
}

// Lists are shared by all instances of a group. So short a run may begin at any of eight places of
// the longest list; longer ones of groups of groups, which may fill the picture many times, would
// show the same points over and over.
static constexpr uint32_t kDeepRun = kLongestList / 8;

// Systematic sampling: the node's points lie at (k + phase) * spacing along the cumulated areas of
// everything below it, in octree order. Passes a range on to whom it belongs, so only subtrees with
// points are visited; what has a list long enough is drawn from it.
void GroupPoints::sweep(ChildRef ref, uint32_t node_index, const Affine& camera_from_group,
                        uint64_t path, double base, double scale) {
    const Group& group = context_.scene.groups[ref.index()];
    const GroupNode& node = group.nodes[node_index];
    if (context_.lists.hasLists(ref)) {
        const uint64_t count = pointsBefore(base + node.area * scale) - pointsBefore(base);
        if (count <= (group.depth > 1 ? kDeepRun : kLongestList)) {
            drawList(camera_from_group, ref, node_index, path, scale, uint32_t(count));
            return;
        }
    }
    for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
        const ChildRef child = group.instances.child(i);
        const double child_scale = scale * group.instances.areaScale(i);
        const double end = base + childArea(context_.scene, child) * child_scale;
        const uint64_t count = pointsBefore(end) - pointsBefore(base);
        if (count > 0) {
            const Affine camera_from_child = camera_from_group * group.instances.groupFromChild(i);
            const uint64_t child_path = extendObjectPath(path, group.listed_index[i]);
            if (child.isGroup()) {
                sweepChild(child, camera_from_child, child_path, base, child_scale, count);
            } else {
                drawList(camera_from_child, child, 0, child_path, child_scale, uint32_t(count));
            }
        }
        base = end;
    }
    for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
        const double end = base + group.nodes[c].area * scale;
        if (pointsBefore(end) > pointsBefore(base))
            sweep(ref, c, camera_from_group, path, base, scale);
        base = end;
    }
}

// A group whose sums have changed since those above were made (Group::as_child) gets its own
// positions, as many points as its area now deserves.
void GroupPoints::sweepChild(ChildRef child, const Affine& camera_from_child, uint64_t path,
                             double base, double scale, uint64_t count) {
    const Group& group = context_.scene.groups[child.index()];
    if (group.area == group.as_child.area) {
        sweep(child, 0, camera_from_child, path, base, scale);
        return;
    }
    const uint64_t n = changedCount(group, double(count), path);
    if (n == 0) return;
    const double spacing = spacing_, phase = phase_;
    spacing_ = group.area * scale / double(n);
    phase_ = uniformDouble(mixBits(path));
    sweep(child, 0, camera_from_child, path, 0.0, scale);
    spacing_ = spacing;
    phase_ = phase;
}

uint64_t GroupPoints::changedCount(const Group& group, double count, uint64_t path) const {
    return roundAtRandom(count * group.area / group.as_child.area,
                         hashCombine(context_.settings.seed, path, 9));
}

uint64_t GroupPoints::pointsBefore(double position) const {
    return uint64_t(std::max(0.0, std::ceil(position / spacing_ - phase_)));
}

RunDensity GroupPoints::childDensity(double scale) const {
    RunDensity density = density_;
    density.drawn *= scale;
    return density;
}

// One point at `position`, in [0, 1), along the cumulated areas: down the trees of sums to an
// instance of a mesh.
void GroupPoints::drawOne(ChildRef ref, uint32_t node, const Affine& camera_from_group,
                          uint64_t path, double scale, double position, uint32_t index) {
    const Group& group = context_.scene.groups[ref.index()];
    const InstancePoint at = instanceAt(context_.scene, group, node, position);
    const ChildRef child = group.instances.child(at.instance);
    const Affine camera_from_child =
        camera_from_group * group.instances.groupFromChild(at.instance);
    const uint64_t child_path = extendObjectPath(path, group.listed_index[at.instance]);
    const double child_scale = scale * group.instances.areaScale(at.instance);
    if (child.isGroup()) {
        const Group& inner = context_.scene.groups[child.index()];
        const uint64_t n = inner.area == inner.as_child.area
                               ? 1
                               : changedCount(inner, 1.0, hashCombine(child_path, index));
        for (uint64_t k = 0; k < n; ++k)
            drawOne(child, 0, camera_from_child, child_path, child_scale, at.position,
                    index + uint32_t(k) * 0x9e3779b9u);
    } else {
        points_.add(makeInstanceFrame(camera_from_child, child_path), {child, 0},
                    childDensity(child_scale), index, 1);
    }
}

namespace {

// Bound of the projection factor over an instance, by its bounding sphere; infinite near the eye.
double instanceBound(const View& view, const InstanceFrame& frame, const Box3& bounds) {
    const double f2 = view.focal * view.focal * frame.area_scale;
    if (view.orthographic) return f2;
    const DVec3 c = frame.camera_from_object.point(DVec3(bounds.center()));
    const double r =
        0.5 * glm::length(DVec3(bounds.extent())) * maxLengthScale(frame.camera_from_object.linear);
    const double z = c.z - r;
    if (z < view.near_z) return std::numeric_limits<double>::infinity();
    const double x = (std::abs(c.x) + r) / z, y = (std::abs(c.y) + r) / z;
    return f2 * std::sqrt(1.0 + x * x + y * y) / (z * z);
}

}  // namespace

// Some points of a whole mesh or of a group's node within a far group.
void GroupPoints::drawList(const Affine& camera_from_child, ChildRef child, uint32_t node,
                           uint64_t path, double scale, uint32_t count) {
    if (count == 0) return;
    const InstanceFrame frame = makeInstanceFrame(camera_from_child, path);
    // The group's node was drawn for its nearest corner; this instance may need fewer.
    RunDensity density = childDensity(scale);
    const double needed = density.wanted * instanceBound(context_.view, frame,
                                                         nodeBounds(context_.scene, child, node));
    double n = count;
    if (needed < density.drawn) {
        n *= needed / density.drawn;
        density.drawn = needed;
    }
    if (!child.isGroup()) {
        const SeenMesh seen = seeMesh(context_, frame, child.index(), density);
        addMeshPoints(context_, points_, frame, child.index(), node, seen, density, n);
        return;
    }
    if (drawsWhatIsSeen(context_.settings)) {
        n *= double(context_.lists.wholeFactor(child.index())
                        .at(float(1.0 / std::sqrt(std::max(density.drawn, 1e-30)))));
    }
    count = uint32_t(roundAtRandom(n, hashCombine(context_.settings.seed, path, node)));
    points_.add(frame, {child, node}, density, points_.firstOf(path, count, kLongestList), count);
}

}  // namespace stipple
