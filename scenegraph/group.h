// SPDX-License-Identifier: Apache-2.0
// Groups of instances and the octree over each: bounds and sums of area (the dynamic distribution
// list: a tree of sums). Based on: Wand et al. 2001 ("Enhanced Data Structure", "Efficient storage
// of highly complex scenes").
#pragma once

#include <scenegraph/instances.h>

#include <string>

namespace stipple {

// Drawing descends through nested groups by recursion; scenes come from strangers.
inline constexpr int kDeepestNesting = 1000;

// Node of the (loose) octree over a group's instances. An instance lies in the node whose cell is
// as large as it is; those residents come first in the node's range, then the ranges of the
// children.
struct GroupNode {
    Box3 bounds;        // group space, of everything below
    double area = 0.0;  // sum over the instances: area of the child x largest area scale of its
                        // transform, m^2
    float max_triangle_area = 0.0f;  // group space bound over everything below
    uint32_t first = 0;              // instances of the whole subtree: [first, first + count)
    uint32_t count = 0;
    uint32_t resident_count = 0;  // the first ones of the range
    uint32_t first_child = 0;
    uint8_t child_count = 0;
};

struct Group {
    std::string name;
    InstanceStore instances;  // in octree order once built
    std::vector<uint32_t>
        listed_index;  // the place an instance had in the scene file; empty: the same

    // What buildScene() adds.
    std::vector<GroupNode> nodes;
    DBox3 bounds;
    double area = 0.0;
    float max_triangle_area = 0.0f;
    double instances_total = 0.0;  // mesh instances below, expanded
    double triangles_total = 0.0;  // triangles below, expanded
    int depth = 1;                 // levels of instancing below (1: meshes only)

    size_t bytes() const;
};

}  // namespace stipple
