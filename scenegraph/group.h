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
// as large as it is: a resident.
struct GroupNode {
    Box3 bounds;        // group space, of everything below
    double area = 0.0;  // sum over the instances: area of the child x largest area scale of its
                        // transform, m^2
    float max_triangle_area = 0.0f;  // group space bound over everything below
    uint32_t first = 0;              // residents: [first, first + resident_count)
    uint32_t resident_count = 0;
    uint32_t count = 0;  // instances of the whole subtree
    uint32_t first_child = 0;
    uint8_t child_count = 0;
    uint16_t free_count = 0;  // places after the residents that are the node's, too
};

// What groups must know of a child.
struct ChildSums {
    DBox3 bounds;       // empty if there is nothing
    double area = 0.0;  // m^2
    float max_triangle_area = 0.0f;
};

struct Group {
    std::string name;
    InstanceStore instances;  // in octree order once built
    // What names an instance: the place it had in the scene file, or a number that was free when it
    // was inserted. Never given twice. Empty before building: the place.
    std::vector<uint32_t> listed_index;
    uint32_t next_index = 0;  // what will be given next
    // Where edits have changed what the scene file's rules make: by listed_index; empty: nowhere.
    std::vector<bool> edited;
    uint32_t ruled_count = 0;  // instances that the rules make
    std::string copy_of;       // the group whose rules made it, if those are not its own

    // What buildScene() adds.
    std::vector<GroupNode> nodes;
    DBox3 bounds;
    double area = 0.0;
    float max_triangle_area = 0.0f;
    // What the sums of the groups that instance it were made with. Edits of a group that is
    // instanced very often leave it behind by less than a factor of two in area, and its bounds by
    // what is in the slack of these groups (scene_editor.h).
    ChildSums as_child;
    // m of group space: how far what is below may stand out of the nodes' bounds, at most.
    float slack = 0.0f;
    double instances_total = 0.0;  // mesh instances below, expanded
    double triangles_total = 0.0;  // triangles below, expanded
    int depth = 1;                 // levels of instancing below (1: meshes only)

    size_t bytes() const;
};

}  // namespace stipple
