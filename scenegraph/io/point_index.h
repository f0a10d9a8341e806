// SPDX-License-Identifier: Apache-2.0
// Points to look up by place, of which some come and go: a k-d tree of small leaves that is built
// anew below a node where one side has become much heavier. (nanoflann's dynamic tree builds trees
// of half of all points anew from time to time, too slow for edits.) Based on: Bentley.
// Multidimensional Binary Search Trees. 1975; Galperin, Rivest. Scapegoat Trees. 1993.
#pragma once

#include <core/math.h>

#include <cstdint>
#include <vector>

namespace stipple {

struct NearPoint {
    float squared = 0.0f;  // distance
    uint32_t index = 0;

    bool operator<(const NearPoint& o) const {
        return squared != o.squared ? squared < o.squared : index < o.index;
    }
};

class PointIndex {
public:
    // Points 0..n-1, finite. O(n log n).
    void build(const std::vector<Vec3>& positions);
    // O(log n), on average over many.
    void insert(uint32_t index, const Vec3& position);
    // position: as it was inserted. Nothing happens if there is no such point.
    void remove(uint32_t index, const Vec3& position);
    size_t size() const { return nodes_.empty() ? 0 : nodes_[0].count; }

    // The k nearest, nearest first; of equally far ones those of lower index.
    void nearest(const Vec3& position, size_t k, std::vector<NearPoint>& out) const;
    struct Item {
        Vec3 position;
        uint32_t index;
    };
    // All up to that distance, in an order that depends on how the index came about.
    void within(const Vec3& position, float radius, std::vector<NearPoint>& out) const;
    // The same, each told to visit(const Item&).
    template <class Visit>
    void forEachWithin(const Vec3& position, float radius, const Visit& visit) const {
        if (!nodes_.empty()) visitBelow(0, position, radius * radius, visit);
    }
    // How many there are up to that distance; as soon as these are more than `most`, some number
    // above it.
    size_t countWithin(const Vec3& position, float radius, size_t most) const;

private:
    struct Node {
        Box3 bounds;
        int axis = -1;  // -1: a leaf
        float split = 0.0f;
        uint32_t left = 0, right = 0;  // below and not below the split
        uint32_t count = 0;
        std::vector<Item> items;
    };

    uint32_t newNode();
    void fill(uint32_t node, std::vector<Item>&& items);
    void takeAll(uint32_t node, std::vector<Item>& items);
    void nearestBelow(uint32_t node, const Vec3& p, size_t k, std::vector<NearPoint>& heap) const;
    size_t countBelow(uint32_t node, const Vec3& p, float squared, size_t most) const;
    template <class Visit>
    void visitBelow(uint32_t node, const Vec3& p, float squared, const Visit& visit) const;

    std::vector<Node> nodes_;  // the first is the root
    std::vector<uint32_t> unused_;
};

template <class Visit>
void PointIndex::visitBelow(uint32_t node, const Vec3& p, float squared, const Visit& visit) const {
    const Node& at = nodes_[node];
    const Vec3 away = glm::max(glm::max(at.bounds.min - p, p - at.bounds.max), Vec3(0.0f));
    if (at.count == 0 || glm::dot(away, away) > squared) return;
    if (at.axis >= 0) {
        visitBelow(at.left, p, squared, visit);
        visitBelow(at.right, p, squared, visit);
        return;
    }
    for (const Item& item : at.items) {
        const Vec3 d = item.position - p;
        if (glm::dot(d, d) <= squared) visit(item);
    }
}

}  // namespace stipple
