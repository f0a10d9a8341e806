// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/group_sums.h>

namespace stipple {

ChildSums childSums(const Scene& scene, ChildRef child) {
    if (child.isGroup()) return scene.groups[child.index()].as_child;
    const Mesh& m = scene.meshes[child.index()];
    ChildSums sums;
    if (!m.bounds.isEmpty()) sums.bounds = {DVec3(m.bounds.min), DVec3(m.bounds.max)};
    sums.area = m.area;
    for (const Stratum& s : m.strata)
        sums.max_triangle_area = std::max(sums.max_triangle_area, s.max_triangle_area);
    return sums;
}

namespace {

DMat3 absolute(const DMat3& m) { return DMat3(glm::abs(m[0]), glm::abs(m[1]), glm::abs(m[2])); }

}  // namespace

DBox3 sumBounds(const Group& group) {
    const Box3 bounds = nodeBounds(group, 0);
    return bounds.isEmpty() ? DBox3() : DBox3{DVec3(bounds.min), DVec3(bounds.max)};
}

bool instanceBox(const ChildSums& child, const Affine& group_from_child, DVec3& center,
                 DVec3& half) {
    const bool has_box = !child.bounds.isEmpty();
    center = has_box ? group_from_child.point(child.bounds.center()) : group_from_child.translation;
    half = has_box ? absolute(group_from_child.linear) * (0.5 * child.bounds.extent()) : DVec3(0.0);
    return has_box;
}

}  // namespace stipple
