// SPDX-License-Identifier: Apache-2.0
// What the nodes of a group's octree sum up.
#pragma once

#include <scenegraph/scene.h>

namespace stipple {

ChildSums childSums(const Scene& scene, ChildRef child);

// Of all that a built group holds, rounded outwards, with its slack; empty if there is nothing.
DBox3 sumBounds(const Group& group);

// An instance's box; false if it is empty (then center is the translation and half 0).
bool instanceBox(const ChildSums& child, const Affine& group_from_child, DVec3& center,
                 DVec3& half);

// Adds up what resides in the node and its children, which have their sums. sums(ChildRef) is as
// childSums(). O(residents + children).
template <class Sums>
void accumulateNode(const Group& group, const std::vector<GroupNode>& nodes, const Sums& sums,
                    GroupNode& node) {
    DBox3 bounds;
    node.area = 0.0;
    node.max_triangle_area = 0.0f;
    node.count = node.resident_count;
    for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
        const ChildSums child = sums(group.instances.child(i));
        DVec3 center, half;
        if (instanceBox(child, group.instances.groupFromChild(i), center, half))
            bounds.extend(DBox3{center - half, center + half});
        const double scale = group.instances.areaScale(i);
        node.area += child.area * scale;
        node.max_triangle_area =
            std::max(node.max_triangle_area, float(child.max_triangle_area * scale));
    }
    for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
        const GroupNode& child = nodes[c];
        if (child.area > 0.0)
            bounds.extend(DBox3{DVec3(child.bounds.min), DVec3(child.bounds.max)});
        node.area += child.area;
        node.max_triangle_area = std::max(node.max_triangle_area, child.max_triangle_area);
        node.count += child.count;
    }
    node.bounds = bounds.isEmpty() ? Box3() : enclosingFloatBox(bounds);
}

}  // namespace stipple
