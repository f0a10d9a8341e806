// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/group_build.h>

#include <scenegraph/group_sums.h>
#include <scenegraph/morton.h>

#include <bit>

namespace stipple {

namespace {

constexpr uint32_t kLeafInstances = 20;
constexpr size_t kChunkInstances = 16384;     // of loops over all instances
constexpr uint32_t kTaskInstances = 1 << 15;  // subtrees up to this size are built by one thread

// The sums of the group's children, looked up once for each child where that is less work than once
// for each instance.
class ChildTable {
public:
    ChildTable(const Scene& scene, const Group& group) : scene_(scene) {
        if (group.instances.size() < scene.meshes.size() + scene.groups.size()) return;
        for (uint32_t i = 0; i < scene.meshes.size(); ++i)
            meshes_.push_back(childSums(scene, ChildRef::mesh(i)));
        for (uint32_t i = 0; i < scene.groups.size(); ++i)
            groups_.push_back(childSums(scene, ChildRef::group(i)));
    }
    ChildSums operator()(ChildRef child) const {
        if (groups_.empty()) return childSums(scene_, child);
        return child.isGroup() ? groups_[child.index()] : meshes_[child.index()];
    }

private:
    const Scene& scene_;
    std::vector<ChildSums> meshes_, groups_;
};

// The cell in which an instance resides: the first code of the cell, then the level (parents before
// children). `index` makes the order total.
struct CellKey {
    uint64_t code;
    uint32_t level;
    uint32_t index;
    bool operator<(const CellKey& o) const {
        if (code != o.code) return code < o.code;
        return level != o.level ? level < o.level : index < o.index;
    }
};

class GroupOctree {
public:
    GroupOctree(const ChildTable& children, Group& group, const std::vector<CellKey>& keys)
        : children_(children), group_(group), keys_(keys) {}

    void build(ThreadPool& pool) {
        std::vector<GroupNode>& nodes = group_.nodes;
        nodes.assign(1, {});
        // The upper levels first, without sums; what hangs below them is built in parallel.
        std::vector<Task> tasks;
        split(nodes, {0, 0, uint32_t(keys_.size()), 0}, &tasks);
        const size_t n_upper = nodes.size();
        std::vector<std::vector<GroupNode>> parts(tasks.size());
        pool.forEach(tasks.size(), [&](size_t i, int) {
            parts[i].push_back({});
            split(parts[i], {0, tasks[i].begin, tasks[i].end, tasks[i].level}, nullptr);
            for (size_t n = parts[i].size(); n-- > 0;) accumulate(parts[i], parts[i][n]);
        });
        size_t n_nodes = n_upper;
        for (const std::vector<GroupNode>& part : parts) n_nodes += part.size() - 1;
        nodes.reserve(n_nodes);
        std::vector<bool> is_done(n_upper, false);
        for (size_t i = 0; i < tasks.size(); ++i) {
            // Node 0 goes to the place it was split off, the others to the end.
            const uint32_t shift = uint32_t(nodes.size()) - 1;
            for (GroupNode& node : parts[i]) node.first_child += shift;
            nodes[tasks[i].node] = parts[i][0];
            is_done[tasks[i].node] = true;
            nodes.insert(nodes.end(), parts[i].begin() + 1, parts[i].end());
            parts[i] = std::vector<GroupNode>();  // {} would keep the memory
        }
        for (size_t n = n_upper; n-- > 0;) {
            if (!is_done[n]) accumulate(nodes, nodes[n]);
        }
    }

private:
    // nodes[node] over instances [begin, end), which lie in one cell of `level` or below it.
    struct Task {
        uint32_t node, begin, end, level;
    };

    // Makes the node and all below it, but sums; children always come after their parents. tasks:
    // where to put small subtrees instead of making them; nullptr: nowhere.
    void split(std::vector<GroupNode>& nodes, Task task, std::vector<Task>* tasks) {
        if (tasks && task.end - task.begin <= kTaskInstances) {
            tasks->push_back(task);
            return;
        }
        const auto [index, begin, end, level] = task;
        GroupNode node;
        node.first = begin;
        uint32_t residents = begin;
        if (end - begin <= kLeafInstances || level == uint32_t(kMortonLevels)) {
            residents = end;
        } else {
            while (residents < end && keys_[residents].level <= level) ++residents;
        }
        node.resident_count = residents - begin;
        std::vector<uint32_t> ends;  // of the children's ranges
        const int shift = 3 * (kMortonLevels - 1 - int(level));
        for (uint32_t b = residents; b < end;) {
            const uint64_t cell = keys_[b].code >> shift;
            b = uint32_t(
                std::partition_point(keys_.begin() + b, keys_.begin() + end,
                                     [&](const CellKey& k) { return k.code >> shift == cell; }) -
                keys_.begin());
            ends.push_back(b);
        }
        if (ends.size() == 1 && node.resident_count == 0)
            return split(nodes, {index, begin, end, level + 1}, tasks);
        if (!ends.empty()) {
            node.first_child = uint32_t(nodes.size());
            node.child_count = uint8_t(ends.size());
            nodes.resize(nodes.size() + ends.size());
        }
        nodes[index] = node;
        for (size_t c = 0; c < ends.size(); ++c) {
            split(nodes,
                  {node.first_child + uint32_t(c), c == 0 ? residents : ends[c - 1], ends[c],
                   level + 1},
                  tasks);
        }
    }

    void accumulate(const std::vector<GroupNode>& nodes, GroupNode& node) const {
        accumulateNode(group_, nodes, children_, node);
    }

    const ChildTable& children_;
    Group& group_;
    const std::vector<CellKey>& keys_;
};

// What a pass over a chunk of instances finds.
struct ChunkSums {
    DBox3 bounds;
    Box3 centers;  // of extents
    double instances = 0.0, triangles = 0.0;
    int depth = 1;
    size_t bad_instance = SIZE_MAX;  // the first with a transform that cannot be
};

// Where an instance's box is and how large. Floats do: they only choose the cell it resides in,
// whose key takes its place.
struct Extent {
    Vec3 center;  // from the first instance's translation
    float diameter;
};
static_assert(sizeof(Extent) == sizeof(CellKey));

ChunkSums measure(const Scene& scene, const Group& group, const ChildTable& children, size_t begin,
                  size_t end, std::vector<CellKey>& extents) {
    ChunkSums sums;
    const DVec3 origin = group.instances.groupFromChild(0).translation;
    for (size_t i = begin; i < end; ++i) {
        const Affine transform = group.instances.groupFromChild(i);
        bool is_good = isFinite(transform);
        if (!group.instances.isSimilarity(i)) {
            const double length = maxLengthScale(transform.linear);
            is_good &=
                std::abs(glm::determinant(transform.linear)) > 1e-12 * length * length * length;
        }
        if (!is_good) {
            sums.bad_instance = i;
            return sums;
        }
        const ChildRef child = group.instances.child(i);
        if (child.isGroup()) {
            const Group& g = scene.groups[child.index()];
            sums.instances += g.instances_total;
            sums.triangles += g.triangles_total;
            sums.depth = std::max(sums.depth, g.depth + 1);
        } else {
            sums.instances += 1.0;
            sums.triangles += double(scene.meshes[child.index()].triangles.size());
        }
        DVec3 center, half;
        const bool has_box = instanceBox(children(child), transform, center, half);
        const Extent extent = {Vec3(center - origin),
                               has_box ? float(2.0 * glm::length(half)) : 0.0f};
        extents[i] = std::bit_cast<CellKey>(extent);
        sums.centers.extend(extent.center);
        if (has_box) sums.bounds.extend(DBox3{center - half, center + half});
    }
    return sums;
}

CellKey cellKey(const Extent& extent, uint32_t index, const DVec3& origin, double side) {
    // The level whose cells are about as large as the instance.
    const int level = std::ilogb(side / std::max(double(extent.diameter), side * 1e-9));
    CellKey key{0, uint32_t(std::clamp(level, 0, kMortonLevels)), index};
    const int dropped = 3 * (kMortonLevels - int(key.level));
    if (dropped < 63)
        key.code = mortonCode(DVec3(extent.center), origin, side) >> dropped << dropped;
    return key;
}

// Instance i is what was instance order[i]: names go with them.
void nameInOrder(Group& group, std::vector<uint32_t> order) {
    if (!group.listed_index.empty()) {
        for (uint32_t& index : order) index = group.listed_index[index];
    }
    group.listed_index = std::move(order);
}

void removeEmpty(Group& group) {
    const size_t n = group.instances.size();
    std::vector<uint32_t> order;
    for (uint32_t i = 0; i < n; ++i) {
        if (group.instances.child(i).isNone()) {
            order.reserve(n);
            for (uint32_t k = 0; k < n; ++k) {
                if (!group.instances.child(k).isNone()) order.push_back(k);
            }
            group.instances.keep(order);
            nameInOrder(group, std::move(order));
            return;
        }
    }
}

}  // namespace

void buildGroup(Scene& scene, Group& group, const std::string& where, ThreadPool& pool) {
    removeEmpty(group);
    const size_t n = group.instances.size();
    const size_t n_chunks = (n + kChunkInstances - 1) / kChunkInstances;
    const ChildTable children(scene, group);
    std::vector<CellKey> keys(n);  // extents at first
    std::vector<ChunkSums> chunks(n_chunks);
    pool.forEach(n_chunks, [&](size_t c, int) {
        const size_t begin = c * kChunkInstances;
        chunks[c] =
            measure(scene, group, children, begin, std::min(n, begin + kChunkInstances), keys);
    });
    group.bounds = DBox3();
    group.instances_total = group.triangles_total = 0.0;
    group.depth = 1;
    Box3 centers;
    for (const ChunkSums& sums : chunks) {
        if (sums.bad_instance != SIZE_MAX) {
            const bool finite = isFinite(group.instances.groupFromChild(sums.bad_instance));
            throw Error(ErrorCode::kInvalidScene, where + "/" + std::to_string(sums.bad_instance),
                        finite ? "singular transform" : "transform is not finite");
        }
        group.bounds.extend(sums.bounds);
        group.instances_total += sums.instances;
        group.triangles_total += sums.triangles;
        group.depth = std::max(group.depth, sums.depth);
        centers.extend(sums.centers);
    }
    if (group.depth > kDeepestNesting) {
        throw Error(ErrorCode::kInvalidScene, where,
                    "groups are nested more than " + std::to_string(kDeepestNesting) + " deep");
    }
    if (!group.bounds.isEmpty() && !isFinite(group.bounds.extent())) {
        throw Error(ErrorCode::kInvalidScene, where, "bounds are not finite");
    }

    const DVec3 extent = n ? DVec3(centers.extent()) : DVec3(1.0);
    const double side = std::max({extent.x, extent.y, extent.z, 1e-30});
    pool.forEach(n_chunks, [&](size_t c, int) {
        const size_t begin = c * kChunkInstances, end = std::min(n, begin + kChunkInstances);
        for (size_t i = begin; i < end; ++i)
            keys[i] =
                cellKey(std::bit_cast<Extent>(keys[i]), uint32_t(i), DVec3(centers.min), side);
    });
    parallelSort(pool, keys, std::less<CellKey>());
    std::vector<uint32_t> order(n);
    for (size_t i = 0; i < n; ++i) order[i] = keys[i].index;
    group.instances.permute(order);
    nameInOrder(group, std::move(order));
    for (const uint32_t index : group.listed_index)
        group.next_index = std::max(group.next_index, index + 1);

    GroupOctree(children, group, keys).build(pool);
    group.nodes.shrink_to_fit();
    group.area = group.nodes[0].area;
    group.max_triangle_area = group.nodes[0].max_triangle_area;
    // As edits will sum it up.
    group.as_child = {sumBounds(group), group.area, group.max_triangle_area};
}

size_t Group::bytes() const {
    return instances.bytes() + listed_index.capacity() * sizeof(uint32_t) +
           nodes.capacity() * sizeof(GroupNode);
}

}  // namespace stipple
