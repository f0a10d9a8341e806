// SPDX-License-Identifier: Apache-2.0
// The octrees of edited groups: where residents go, and how nodes are split, merged and made anew.
#include <scenegraph/group_sums.h>
#include <scenegraph/scene_editor.h>

#include <algorithm>
#include <bit>
#include <functional>

namespace stipple {

namespace {

constexpr uint32_t kMostResidents = 32;  // of a leaf, before it is split
constexpr size_t kMostChanges = 1 << 16;
constexpr size_t kMostBoxes = 256;
constexpr int kMostBoxSteps = 4096;  // from group to group

uint32_t placesOf(const GroupNode& node) { return node.resident_count + node.free_count; }

uint32_t capacityFor(uint32_t count) { return std::bit_ceil(std::max(count, 4u)); }

}  // namespace

void SceneEditor::place(InstanceId id, ChildRef child, const Affine& group_from_child) {
    addUse(id, child, maxLengthScale(group_from_child.linear));
    if (child.isGroup()) updateSlack(id.group);
    markEdited(id);
    noteMember(id);
    if (child.isGroup()) deepen(id.group, scene_.groups[child.index()].depth + 1);
    DVec3 center, half;
    if (instanceBox(childSums(scene_, child), group_from_child, center, half))
        noteBox(id.group, {center - half, center + half});
    const uint32_t node = chooseNode(scene_.groups[id.group], center, half);
    addResident(id.group, node, id.index, child, group_from_child);
    uint32_t changed = node;
    if (scene_.groups[id.group].nodes[node].child_count == 0 &&
        scene_.groups[id.group].nodes[node].resident_count > kMostResidents) {
        split(id.group, node);
        changed = rebuildIfTooDeep(id.group, scene_.groups[id.group].nodes[node].first_child);
    }
    const bool is_group = child.isGroup();
    countInstances(id.group, is_group ? scene_.groups[child.index()].instances_total : 1.0,
                   is_group ? scene_.groups[child.index()].triangles_total
                            : double(scene_.meshes[child.index()].triangles.size()));
    refreshUpwards(id.group, changed);
}

void SceneEditor::take(InstanceId id) {
    OpenGroup& open = *open_[id.group];
    Group& group = scene_.groups[id.group];
    const uint32_t slot = open.slot_of[id.index], node_index = open.node_of[slot];
    const ChildRef child = group.instances.child(slot);
    DVec3 center, half;
    if (instanceBox(childSums(scene_, child), group.instances.groupFromChild(slot), center, half))
        noteBox(id.group, {center - half, center + half});
    removeUse(id, child);
    if (child.isGroup()) updateSlack(id.group);
    markEdited(id);
    noteMember(id);
    const bool is_group = child.isGroup();
    countInstances(id.group, is_group ? -scene_.groups[child.index()].instances_total : -1.0,
                   is_group ? -scene_.groups[child.index()].triangles_total
                            : -double(scene_.meshes[child.index()].triangles.size()));
    GroupNode& node = group.nodes[node_index];
    const uint32_t last = node.first + node.resident_count - 1;
    for (uint32_t i = slot; i < last; ++i) {
        group.instances.swap(i, i + 1);
        group.listed_index[i] = group.listed_index[i + 1];
        open.slot_of[group.listed_index[i]] = i;
    }
    group.instances.erase(last);
    open.slot_of[id.index] = kGone;
    --node.resident_count;
    if (node.free_count < 0xffff) ++node.free_count;
    // Few below the parent: one leaf again.
    uint32_t start = node_index;
    while (start != 0 && group.nodes[start].child_count == 0) {
        const uint32_t parent = open.parent[start];
        const GroupNode& p = group.nodes[parent];
        uint32_t count = p.resident_count;
        bool has_leaves = true;
        for (uint32_t c = p.first_child; c < p.first_child + p.child_count; ++c) {
            has_leaves &= group.nodes[c].child_count == 0;
            count += group.nodes[c].resident_count;
        }
        if (!has_leaves || count > open.merge_at[parent]) break;
        collapse(id.group, parent);
        start = parent;
    }
    refreshUpwards(id.group, start);
}

// The order of residents: as they were when the group was opened, then as they came. What goes and
// comes again finds its old place, on which points depend.
bool SceneEditor::isBefore(const OpenGroup& open, uint32_t name_a, uint32_t name_b) {
    const auto rank = [&](uint32_t name) {
        return name < open.rank_of.size() ? open.rank_of[name] : name;
    };
    return std::pair(rank(name_a), name_a) < std::pair(rank(name_b), name_b);
}

// Down to the child that must grow least; what is about as large as a node stays in it.
uint32_t SceneEditor::chooseNode(const Group& group, const DVec3& center, const DVec3& half) const {
    uint32_t index = 0;
    const Vec3 lo = Vec3(center - half), hi = Vec3(center + half);
    const float size = float(2.0 * glm::length(half));
    for (;;) {
        const GroupNode& node = group.nodes[index];
        if (node.child_count == 0) return index;
        const bool is_full = node.resident_count > kMostResidents;
        if (!is_full && size > 0.5f * glm::length(node.bounds.extent())) return index;
        float least = kInfinity;
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const Box3& b = group.nodes[c].bounds;
            float growth = 0.0f;  // of the sum of its sides; then what is nearest
            if (!b.isEmpty()) {
                const Vec3 extent = glm::max(b.max, hi) - glm::min(b.min, lo) - b.extent();
                growth =
                    extent.x + extent.y + extent.z + 1e-6f * glm::length(b.center() - Vec3(center));
            } else {
                growth = size;
            }
            if (growth < least) least = growth, index = c;
        }
    }
}

// capacity: places of a power of two are used again.
uint32_t SceneEditor::takePlaces(uint32_t group_index, uint32_t capacity) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t>& free = open.free_places[size_t(std::countr_zero(capacity))];
    if (std::has_single_bit(capacity) && !free.empty()) {
        const uint32_t first = free.back();
        free.pop_back();
        return first;
    }
    const uint32_t first = uint32_t(group.instances.size());
    group.instances.addEmpty(capacity);
    group.listed_index.resize(first + capacity, kGone);
    open.node_of.resize(first + capacity, kGone);
    return first;
}

void SceneEditor::freePlaces(uint32_t group, uint32_t first, uint32_t capacity) {
    // Places from building come in any number: in pieces.
    while (capacity > 0) {
        const uint32_t piece = std::bit_floor(capacity);
        open_[group]->free_places[size_t(std::countr_zero(piece))].push_back(first);
        first += piece;
        capacity -= piece;
    }
}

// To a free place of a node.
void SceneEditor::moveResident(uint32_t group_index, uint32_t from, uint32_t to, uint32_t node) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    group.instances.swap(from, to);
    group.listed_index[to] = group.listed_index[from];
    open.slot_of[group.listed_index[to]] = to;
    open.node_of[to] = node;
}

void SceneEditor::addResident(uint32_t group_index, uint32_t node_index, uint32_t name,
                              ChildRef child, const Affine& group_from_child) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    if (group.nodes[node_index].free_count == 0) {
        const uint32_t count = group.nodes[node_index].resident_count;
        const uint32_t capacity = std::min(capacityFor(count + 1), count + 0x8000);
        const uint32_t to = takePlaces(group_index, capacity);
        const uint32_t first = group.nodes[node_index].first;
        for (uint32_t i = 0; i < count; ++i)
            moveResident(group_index, first + i, to + i, node_index);
        GroupNode& node = group.nodes[node_index];
        freePlaces(group_index, node.first, count);
        node.first = to;
        node.free_count = uint16_t(capacity - count);
    }
    GroupNode& node = group.nodes[node_index];
    --node.free_count;
    uint32_t slot = node.first + node.resident_count++;
    for (; slot > node.first && isBefore(open, name, group.listed_index[slot - 1]); --slot) {
        group.instances.swap(slot, slot - 1);
        group.listed_index[slot] = group.listed_index[slot - 1];
        open.slot_of[group.listed_index[slot]] = slot;
        open.node_of[slot] = node_index;
    }
    group.instances.set(slot, child, group_from_child);
    group.listed_index[slot] = name;
    open.slot_of[name] = slot;
    open.node_of[slot] = node_index;
}

uint32_t SceneEditor::takeNodes(uint32_t group_index, uint32_t count) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t>& free = open.free_nodes[count];
    if (!free.empty()) {
        const uint32_t first = free.back();
        free.pop_back();
        return first;
    }
    const uint32_t first = uint32_t(group.nodes.size());
    group.nodes.resize(first + count);
    open.parent.resize(first + count, 0);
    open.merge_at.resize(first + count, 0);
    return first;
}

namespace {

// Cuts members into two halves at the median of the axis along which they are spread most, these
// again, and so on; what comes out is eight lists at most, each in its old order.
void cutInHalves(const std::vector<DVec3>& centers, std::vector<uint32_t> members, int cuts,
                 std::vector<std::vector<uint32_t>>& parts) {
    if (cuts == 0 || members.size() < 2) {
        std::sort(members.begin(), members.end());
        parts.push_back(std::move(members));
        return;
    }
    DBox3 box;
    for (const uint32_t i : members) box.extend(centers[i]);
    const DVec3 extent = box.extent();
    const int axis =
        extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
    const auto middle = members.begin() + std::ptrdiff_t(members.size() / 2);
    std::nth_element(members.begin(), middle, members.end(), [&](uint32_t a, uint32_t b) {
        return std::pair(centers[a][axis], a) < std::pair(centers[b][axis], b);
    });
    cutInHalves(centers, {members.begin(), middle}, cuts - 1, parts);
    cutInHalves(centers, {middle, members.end()}, cuts - 1, parts);
}

}  // namespace

// A leaf's residents go to eight children of as many each, and those are split in turn.
void SceneEditor::split(uint32_t group_index, uint32_t node_index) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    const uint32_t n = group.nodes[node_index].resident_count,
                   first = group.nodes[node_index].first;
    std::vector<DVec3> centers(n);
    std::vector<uint32_t> all(n);
    for (uint32_t i = 0; i < n; ++i) {
        DVec3 half;
        instanceBox(childSums(scene_, group.instances.child(first + i)),
                    group.instances.groupFromChild(first + i), centers[i], half);
        all[i] = i;
    }
    std::vector<std::vector<uint32_t>> parts;
    cutInHalves(centers, std::move(all), 3, parts);
    const uint32_t first_child = takeNodes(group_index, uint32_t(parts.size()));
    for (uint32_t p = 0; p < parts.size(); ++p) {
        const uint32_t c = first_child + p;
        const uint32_t count = uint32_t(parts[p].size()),
                       capacity = std::min(capacityFor(count), count + 0x8000);
        GroupNode child;
        child.first = takePlaces(group_index, capacity);
        child.free_count = uint16_t(capacity - count);
        for (const uint32_t i : parts[p]) {
            noteMember({group_index, group.listed_index[first + i]});
            moveResident(group_index, first + i, child.first + child.resident_count++, c);
        }
        open.parent[c] = node_index;
        group.nodes[c] = child;
        if (count > kMostResidents) split(group_index, c);
        accumulateNode(
            group, group.nodes, [&](ChildRef r) { return childSums(scene_, r); }, group.nodes[c]);
        note(group_index, c);
    }
    GroupNode& node = group.nodes[node_index];
    freePlaces(group_index, node.first, placesOf(node));
    node.first = node.resident_count = 0;
    node.free_count = 0;
    node.first_child = first_child;
    node.child_count = uint8_t(parts.size());
    open.merge_at[node_index] = kMostResidents;
}

// All below the node into one leaf.
void SceneEditor::collapse(uint32_t group_index, uint32_t node_index) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t> nodes{node_index}, slots;
    for (size_t i = 0; i < nodes.size(); ++i) {
        const GroupNode& node = group.nodes[nodes[i]];
        for (uint32_t r = 0; r < node.resident_count; ++r) slots.push_back(node.first + r);
        for (uint32_t c = 0; c < node.child_count; ++c) nodes.push_back(node.first_child + c);
    }
    std::sort(slots.begin(), slots.end(), [&](uint32_t a, uint32_t b) {
        return isBefore(open, group.listed_index[a], group.listed_index[b]);
    });
    const uint32_t count = uint32_t(slots.size()),
                   capacity = std::min(capacityFor(count), count + 0x8000),
                   to = takePlaces(group_index, capacity);
    for (uint32_t i = 0; i < count; ++i) {
        noteMember({group_index, group.listed_index[slots[i]]});
        moveResident(group_index, slots[i], to + i, node_index);
    }
    for (const uint32_t n : nodes) {
        GroupNode& node = group.nodes[n];
        freePlaces(group_index, node.first, placesOf(node));
        if (node.child_count > 0) open.free_nodes[node.child_count].push_back(node.first_child);
        node = GroupNode();
        note(group_index, n);
    }
    GroupNode& node = group.nodes[node_index];
    node.first = to;
    node.resident_count = count;
    node.free_count = uint16_t(capacity - count);
}

// Based on: Galperin, Rivest. Scapegoat Trees. 1993. Where a leaf lies deeper than twice what would
// do, the lowest node above it that is to blame is made anew. Returns the node below which all sums
// are right: that one, or the leaf's parent.
uint32_t SceneEditor::rebuildIfTooDeep(uint32_t group_index, uint32_t leaf) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    // A tree of eight children a node has half of these levels.
    const auto mostLevels = [](uint32_t count) {
        return 1.0 + std::log2(std::max(count / 8.0, 1.0)) / 2.0;
    };
    int depth = 0;
    for (uint32_t n = leaf; n != 0; n = open.parent[n]) ++depth;
    const double allowed =
        std::max(mostLevels(group.nodes[0].count), double(open.built_height + 1));
    if (depth <= allowed) return open.parent[leaf];
    int levels = 1;
    uint32_t node = open.parent[leaf];
    for (; node != 0; node = open.parent[node], ++levels) {
        if (levels > mostLevels(group.nodes[node].count)) break;
    }
    collapse(group_index, node);
    if (group.nodes[node].resident_count > kMostResidents) split(group_index, node);
    return node;
}

void SceneEditor::note(uint32_t group, uint32_t node) {
    changes_.any = true;
    if (!changes_.all_nodes) changes_.nodes.push_back({group, node});
    forgetIfTooMany();
}

void SceneEditor::noteMember(InstanceId id) {
    changes_.any = true;
    if (!changes_.all_nodes) changes_.instances.push_back(id);
    forgetIfTooMany();
}

void SceneEditor::forgetIfTooMany() {
    if (changes_.nodes.size() + changes_.instances.size() <= kMostChanges) return;
    changes_.all_nodes = true;
    changes_.nodes.clear();
    changes_.instances.clear();
}

// Of a box in a group: everywhere that the group is instanced.
void SceneEditor::noteBox(uint32_t group, const DBox3& box) {
    int steps = 0;
    noteBox(group, box, steps);
}

void SceneEditor::noteBox(uint32_t group, const DBox3& box, int& steps) {
    if (changes_.anywhere) return;
    if (group == scene_.root) changes_.boxes.push_back(box);
    const Uses& uses = uses_[group];
    if (uses.places.size() != uses.count || changes_.boxes.size() > kMostBoxes ||
        ++steps > kMostBoxSteps) {
        changes_.anywhere = true;
        changes_.boxes.clear();
        return;
    }
    for (const InstanceId& use : uses.places)
        noteBox(use.group, transformBox(groupFromChild(use), box), steps);
}

void SceneEditor::refreshUpwards(uint32_t group, uint32_t node) {
    Dirty dirty;
    addDirty(group, node, dirty);
    refresh(std::move(dirty));
}

// The nodes and those above them, children before parents.
void SceneEditor::refreshNodes(uint32_t group_index, const std::vector<uint32_t>& nodes) {
    const OpenGroup& open = opened(group_index);
    Group& group = scene_.groups[group_index];
    std::vector<std::pair<int, uint32_t>> order;  // levels below the root, node
    if (std::find(nodes.begin(), nodes.end(), kGone) != nodes.end()) {
        order = {{0, 0}};
        for (size_t i = 0; i < order.size(); ++i) {
            const auto [level, index] = order[i];
            const GroupNode& node = group.nodes[index];
            for (uint32_t c = 0; c < node.child_count; ++c)
                order.emplace_back(level + 1, node.first_child + c);
        }
        std::reverse(order.begin(), order.end());
    } else {
        for (const uint32_t node : nodes) {
            int level = 0;
            for (uint32_t n = node; n != 0; n = open.parent[n]) ++level;
            for (uint32_t n = node; n != 0; n = open.parent[n]) order.emplace_back(level--, n);
            order.emplace_back(0, 0);
        }
        // The path of one node is in order.
        if (nodes.size() > 1) {
            std::sort(order.begin(), order.end(), std::greater<>());
            order.erase(std::unique(order.begin(), order.end()), order.end());
        }
    }
    for (const auto& [level, node] : order) {
        accumulateNode(
            group, group.nodes, [&](ChildRef r) { return childSums(scene_, r); },
            group.nodes[node]);
        note(group_index, node);
    }
    const GroupNode& root = group.nodes[0];
    group.area = root.area;
    group.max_triangle_area = root.max_triangle_area;
    group.bounds = sumBounds(group);
}

}  // namespace stipple
