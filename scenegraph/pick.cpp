// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/pick.h>

#include <scenegraph/object_id.h>

namespace stipple {

namespace {

struct Picker {
    const Scene& scene;
    const uint32_t object;
    std::vector<uint32_t> path;

    static bool holds(const Box3& box, const DVec3& p, double tolerance) {
        return !box.isEmpty() && glm::all(glm::greaterThanEqual(p, DVec3(box.min) - tolerance)) &&
               glm::all(glm::lessThanEqual(p, DVec3(box.max) + tolerance));
    }

    // p and tolerance: in the group's space.
    bool find(const Group& group, uint32_t node_index, const DVec3& p, double tolerance,
              uint64_t hash) {
        const GroupNode& node = group.nodes[node_index];
        if (!holds(nodeBounds(group, node_index), p, tolerance)) return false;
        for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
            const ChildRef child = group.instances.child(i);
            const Affine group_from_child = group.instances.groupFromChild(i);
            const DMat3 child_from_group = glm::inverse(group_from_child.linear);
            const DVec3 q = child_from_group * (p - group_from_child.translation);
            const double t = tolerance * maxLengthScale(child_from_group);
            const uint32_t name = group.listed_index[i];
            const uint64_t child_hash = extendObjectPath(hash, name);
            path.push_back(name);
            if (child.isGroup() ? find(scene.groups[child.index()], 0, q, t, child_hash)
                                : (objectId(child_hash) & 0xffffffu) == object &&
                                      holds(scene.meshes[child.index()].bounds, q, t))
                return true;
            path.pop_back();
        }
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            if (find(group, c, p, tolerance, hash)) return true;
        }
        return false;
    }
};

}  // namespace

std::vector<uint32_t> pathOfObject(const Scene& scene, uint32_t object, const DVec3& point,
                                   double tolerance) {
    Picker picker{scene, object, {}};
    if (!picker.find(scene.groups[scene.root], 0, point, tolerance, 0)) return {};
    return std::move(picker.path);
}

}  // namespace stipple
