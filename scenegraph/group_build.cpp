// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/group_build.h>

#include <scenegraph/morton.h>

#include <numeric>

namespace stipple {

namespace {

constexpr uint32_t kLeafInstances = 20;

// What a group must know of a child: a mesh or another group.
struct ChildSums {
    DBox3 bounds;
    double area = 0.0;
    float max_triangle_area = 0.0f;
};

ChildSums childSums(const Scene& scene, ChildRef child) {
    ChildSums sums;
    if (child.isGroup()) {
        const Group& g = scene.groups[child.index()];
        sums = {g.bounds, g.area, g.max_triangle_area};
    } else {
        const Mesh& m = scene.meshes[child.index()];
        if (!m.bounds.isEmpty())
            sums.bounds.extend(DVec3(m.bounds.min)), sums.bounds.extend(DVec3(m.bounds.max));
        sums.area = m.area;
        for (const Stratum& s : m.strata) {
            sums.max_triangle_area = std::max(sums.max_triangle_area, s.max_triangle_area);
        }
    }
    return sums;
}

ChildSums instanceSums(const Scene& scene, const Group& group, size_t i) {
    const Affine transform = group.instances.groupFromChild(i);
    ChildSums sums = childSums(scene, group.instances.child(i));
    const double scale = maxAreaScale(transform.linear);
    sums.bounds = transformBox(transform, sums.bounds);
    sums.area *= scale;
    sums.max_triangle_area *= float(scale);
    return sums;
}

// Sort key of an instance: the first code of the cell it resides in, then the level (parents before
// children).
struct CellKey {
    uint64_t code;
    uint32_t level;
    bool operator<(const CellKey& o) const {
        return code != o.code ? code < o.code : level < o.level;
    }
};

class GroupOctree {
public:
    GroupOctree(const Scene& scene, Group& group, const std::vector<CellKey>& keys)
        : scene_(scene), group_(group), keys_(keys) {}

    void build() {
        group_.nodes.clear();
        group_.nodes.push_back({});
        fill(0, 0, uint32_t(keys_.size()), 0);
    }

private:
    // Makes nodes[index] the node over instances [begin, end), which lie in one cell of `level` or
    // below it.
    void fill(uint32_t index, uint32_t begin, uint32_t end, uint32_t level) {
        GroupNode node;
        node.first = begin;
        node.count = end - begin;
        uint32_t split = begin;
        if (end - begin <= kLeafInstances || level == uint32_t(kMortonLevels)) {
            split = end;
        } else {
            while (split < end && keys_[split].level <= level) ++split;
        }
        node.resident_count = split - begin;
        DBox3 bounds;
        for (uint32_t i = begin; i < split; ++i) {
            const ChildSums sums = instanceSums(scene_, group_, i);
            bounds.extend(sums.bounds);
            node.area += sums.area;
            node.max_triangle_area = std::max(node.max_triangle_area, sums.max_triangle_area);
        }
        if (split < end) {
            const int shift = 3 * (kMortonLevels - 1 - int(level));
            std::vector<std::pair<uint32_t, uint32_t>> ranges;
            for (uint32_t b = split; b < end;) {
                const uint64_t cell = keys_[b].code >> shift;
                uint32_t e = b;
                while (e < end && keys_[e].code >> shift == cell) ++e;
                ranges.emplace_back(b, e);
                b = e;
            }
            if (ranges.size() == 1 && node.resident_count == 0)
                return fill(index, begin, end, level + 1);
            node.first_child = uint32_t(group_.nodes.size());
            node.child_count = uint8_t(ranges.size());
            group_.nodes.resize(group_.nodes.size() + ranges.size());
            for (size_t c = 0; c < ranges.size(); ++c) {
                fill(node.first_child + uint32_t(c), ranges[c].first, ranges[c].second, level + 1);
                const GroupNode& child = group_.nodes[node.first_child + c];
                if (child.count > 0 && child.area > 0.0) {
                    bounds.extend(DVec3(child.bounds.min)), bounds.extend(DVec3(child.bounds.max));
                }
                node.area += child.area;
                node.max_triangle_area = std::max(node.max_triangle_area, child.max_triangle_area);
            }
        }
        if (!bounds.isEmpty()) node.bounds = enclosingFloatBox(bounds);
        group_.nodes[index] = node;
    }

    const Scene& scene_;
    Group& group_;
    const std::vector<CellKey>& keys_;
};

}  // namespace

void buildGroup(Scene& scene, Group& group, const std::string& where) {
    const size_t n = group.instances.size();
    group.bounds = DBox3();
    group.instances_total = group.triangles_total = 0.0;
    group.depth = 1;
    std::vector<DVec3> centers(n);
    std::vector<float> diameters(n);
    DBox3 center_box;
    for (size_t i = 0; i < n; ++i) {
        const Affine transform = group.instances.groupFromChild(i);
        const double determinant = glm::determinant(transform.linear);
        const double length = maxLengthScale(transform.linear);
        if (!isFinite(transform) || !(std::abs(determinant) > 1e-12 * length * length * length)) {
            throw Error(ErrorCode::kInvalidScene, where + "/" + std::to_string(i),
                        isFinite(transform) ? "singular transform" : "transform is not finite");
        }
        const ChildRef child = group.instances.child(i);
        const DBox3 bounds = transformBox(transform, childSums(scene, child).bounds);
        if (child.isGroup()) {
            const Group& g = scene.groups[child.index()];
            group.instances_total += g.instances_total;
            group.triangles_total += g.triangles_total;
            group.depth = std::max(group.depth, g.depth + 1);
        } else {
            group.instances_total += 1.0;
            group.triangles_total += double(scene.meshes[child.index()].triangles.size());
        }
        centers[i] = bounds.isEmpty() ? transform.translation : bounds.center();
        diameters[i] = bounds.isEmpty() ? 0.0f : float(glm::length(bounds.extent()));
        center_box.extend(centers[i]);
        group.bounds.extend(bounds);
    }
    if (!group.bounds.isEmpty() && !isFinite(group.bounds.extent())) {
        throw Error(ErrorCode::kInvalidScene, where, "bounds are not finite");
    }

    const DVec3 extent = n ? center_box.extent() : DVec3(1.0);
    const double side = std::max({extent.x, extent.y, extent.z, 1e-30});
    std::vector<CellKey> keys(n);
    for (size_t i = 0; i < n; ++i) {
        // The level whose cells are about as large as the instance.
        const double level =
            std::floor(std::log2(side / std::max(double(diameters[i]), side * 1e-9)));
        keys[i].level = uint32_t(std::clamp(level, 0.0, double(kMortonLevels)));
        const int dropped = 3 * (kMortonLevels - int(keys[i].level));
        const uint64_t code = mortonCode(centers[i], center_box.min, side);
        keys[i].code = dropped >= 63 ? 0 : code >> dropped << dropped;
    }
    std::vector<uint32_t> order(n);
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return keys[a] < keys[b] || (!(keys[b] < keys[a]) && a < b);
    });
    std::vector<CellKey> sorted(n);
    for (size_t i = 0; i < n; ++i) sorted[i] = keys[order[i]];
    keys = {}, centers = {}, diameters = {};
    group.instances.permute(order);
    group.listed_index = std::move(order);

    GroupOctree(scene, group, sorted).build();
    group.nodes.shrink_to_fit();
    group.area = group.nodes[0].area;
    group.max_triangle_area = group.nodes[0].max_triangle_area;
}

size_t Group::bytes() const {
    return instances.bytes() + listed_index.capacity() * sizeof(uint32_t) +
           nodes.capacity() * sizeof(GroupNode);
}

}  // namespace stipple
