// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/point_index.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr size_t kLeaf = 16;

float squaredLength(const Vec3& d) { return glm::dot(d, d); }

float squaredDistance(const Box3& box, const Vec3& p) {
    return squaredLength(glm::max(glm::max(box.min - p, p - box.max), Vec3(0.0f)));
}

}  // namespace

void PointIndex::build(const std::vector<Vec3>& positions) {
    nodes_.clear();
    unused_.clear();
    std::vector<Item> items;
    for (uint32_t i = 0; i < positions.size(); ++i) items.push_back({positions[i], i});
    fill(newNode(), std::move(items));
}

uint32_t PointIndex::newNode() {
    if (unused_.empty()) {
        nodes_.emplace_back();
        return uint32_t(nodes_.size() - 1);
    }
    const uint32_t node = unused_.back();
    unused_.pop_back();
    return node;
}

// Makes the subtree of the items.
void PointIndex::fill(uint32_t node, std::vector<Item>&& items) {
    Node made;
    made.count = uint32_t(items.size());
    for (const Item& item : items) made.bounds.extend(item.position);
    const Vec3 extent = items.empty() ? Vec3(0.0f) : made.bounds.extent();
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0
                     : extent.y >= extent.z                       ? 1
                                                                  : 2;
    if (items.size() <= kLeaf || !(extent[axis] > 0.0f)) {
        made.items = std::move(items);
        nodes_[node] = std::move(made);
        return;
    }
    const auto middle = items.begin() + std::ptrdiff_t(items.size() / 2);
    std::nth_element(items.begin(), middle, items.end(), [&](const Item& a, const Item& b) {
        return a.position[axis] < b.position[axis];
    });
    made.axis = axis;
    made.split = middle->position[axis];
    // Something lies below the split.
    if (!(made.bounds.min[axis] < made.split)) {
        made.split = made.bounds.max[axis];
        for (const Item& item : items) {
            if (item.position[axis] > made.bounds.min[axis])
                made.split = std::min(made.split, item.position[axis]);
        }
    }
    std::vector<Item> left, right;
    for (const Item& item : items)
        (item.position[axis] < made.split ? left : right).push_back(item);
    items = std::vector<Item>();  // {} would keep the memory
    made.left = newNode();
    made.right = newNode();
    const uint32_t below = made.left, above = made.right;
    nodes_[node] = std::move(made);
    fill(below, std::move(left));
    fill(above, std::move(right));
}

void PointIndex::takeAll(uint32_t node, std::vector<Item>& items) {
    if (nodes_[node].axis < 0) {
        items.insert(items.end(), nodes_[node].items.begin(), nodes_[node].items.end());
        return;
    }
    for (const uint32_t child : {nodes_[node].left, nodes_[node].right}) {
        takeAll(child, items);
        unused_.push_back(child);
    }
}

void PointIndex::insert(uint32_t index, const Vec3& p) {
    if (nodes_.empty()) newNode();
    constexpr uint32_t kUnbalanced = 4 * kLeaf;
    for (uint32_t node = 0;;) {
        Node& at = nodes_[node];
        at.bounds.extend(p);
        ++at.count;
        if (at.axis < 0) {
            at.items.push_back({p, index});
            // Many at one place stay in one leaf.
            if (at.items.size() > 2 * kLeaf && at.bounds.min != at.bounds.max)
                fill(node, std::vector<Item>(at.items));
            return;
        }
        const uint32_t next = p[at.axis] < at.split ? at.left : at.right;
        if (4 * (nodes_[next].count + 1) > 3 * at.count + kUnbalanced) {
            std::vector<Item> items = {{p, index}};
            takeAll(node, items);
            fill(node, std::move(items));
            return;
        }
        node = next;
    }
}

void PointIndex::remove(uint32_t index, const Vec3& p) {
    std::vector<uint32_t> path;
    for (uint32_t node = 0; node < nodes_.size();) {
        Node& at = nodes_[node];
        path.push_back(node);
        if (at.axis >= 0) {
            node = p[at.axis] < at.split ? at.left : at.right;
            continue;
        }
        for (Item& item : at.items) {
            if (item.index != index) continue;
            item = at.items.back();
            at.items.pop_back();
            for (const uint32_t n : path) --nodes_[n].count;
            break;
        }
        return;
    }
}

void PointIndex::nearest(const Vec3& p, size_t k, std::vector<NearPoint>& out) const {
    out.clear();
    if (!nodes_.empty() && k > 0) nearestBelow(0, p, k, out);
    std::sort_heap(out.begin(), out.end());
}

void PointIndex::nearestBelow(uint32_t node, const Vec3& p, size_t k,
                              std::vector<NearPoint>& heap) const {
    const Node& at = nodes_[node];
    if (at.count == 0 || (heap.size() == k && squaredDistance(at.bounds, p) > heap[0].squared))
        return;
    if (at.axis >= 0) {
        const bool is_below = p[at.axis] < at.split;
        nearestBelow(is_below ? at.left : at.right, p, k, heap);
        nearestBelow(is_below ? at.right : at.left, p, k, heap);
        return;
    }
    for (const Item& item : at.items) {
        const NearPoint near = {squaredLength(item.position - p), item.index};
        if (heap.size() < k) {
            heap.push_back(near);
            std::push_heap(heap.begin(), heap.end());
        } else if (near < heap[0]) {
            std::pop_heap(heap.begin(), heap.end());
            heap.back() = near;
            std::push_heap(heap.begin(), heap.end());
        }
    }
}

void PointIndex::within(const Vec3& p, float radius, std::vector<NearPoint>& out) const {
    out.clear();
    forEachWithin(p, radius, [&](const Item& item) {
        out.push_back({squaredLength(item.position - p), item.index});
    });
}

size_t PointIndex::countWithin(const Vec3& p, float radius, size_t most) const {
    return nodes_.empty() ? 0 : countBelow(0, p, radius * radius, most);
}

size_t PointIndex::countBelow(uint32_t node, const Vec3& p, float squared, size_t most) const {
    const Node& at = nodes_[node];
    if (at.count == 0 || squaredDistance(at.bounds, p) > squared) return 0;
    const Vec3 farthest = glm::max(p - at.bounds.min, at.bounds.max - p);
    if (squaredLength(farthest) <= squared) return at.count;
    if (at.axis < 0) {
        return size_t(std::count_if(at.items.begin(), at.items.end(), [&](const Item& item) {
            return squaredLength(item.position - p) <= squared;
        }));
    }
    const size_t left = countBelow(at.left, p, squared, most);
    return left > most ? left : left + countBelow(at.right, p, squared, most - left);
}

}  // namespace stipple
