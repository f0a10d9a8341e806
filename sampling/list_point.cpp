// SPDX-License-Identifier: Apache-2.0
#include <sampling/list_point.h>

#include <core/rng.h>

#include <algorithm>

namespace stipple {

double listPosition(const PointKey& key) {
    if (key.sampler == Sampler::kRandom) return uniformDouble(hashCombine(key.list, key.index));
    // Sixteen points in a row fall into sixteen strata, in an order of their own: a run of one
    // point may lie anywhere, wherever in the sequence it begins.
    const uint32_t order = uint32_t(hashCombine(key.list, key.index >> 4, 4)) << 28;
    const double t = double(reverseBits(key.index) ^ order) * 0x1p-32 + uniformDouble(key.list);
    return t - std::floor(t);
}

double positionResolution(Sampler sampler) {
    return sampler == Sampler::kRandom ? 0x1p-50 : 0x1p-12;
}

template <class T>
MeshPoint meshPointAt(const std::vector<T>& cumulative_area, const MeshNode& node, double position,
                      const PointKey& key) {
    const T* cumulative = cumulative_area.data();
    const uint32_t first = node.first_triangle, count = node.triangle_count;
    const double begin = cumulative[first], area = double(cumulative[first + count]) - begin;
    const double target = begin + position * area;
    const T* found = std::upper_bound(cumulative + first + 1, cumulative + first + count, target);
    MeshPoint p;
    p.triangle = uint32_t(found - cumulative) - 1;
    const double triangle_area = double(cumulative[p.triangle + 1]) - cumulative[p.triangle];
    double r = triangle_area > 0.0
                   ? std::clamp((target - cumulative[p.triangle]) / triangle_area, 0.0, 1.0)
                   : 0.0;
    if (key.sampler == Sampler::kRandom) {
        const float a = std::sqrt(float(r)), b = uniformFloat(hashCombine(key.list, key.index, 1));
        p.u = a * (1.0f - b), p.v = a * b;
        return p;
    }
    // Base-4 digits of the remainder choose one of four sub-triangles, coarse to fine.
    Vec2 a(0, 0), b(1, 0), c(0, 1);
    for (int digit = 0; digit < 8; ++digit) {
        r *= 4.0;
        const int d = std::min(int(r), 3);
        r -= d;
        const Vec2 ab = 0.5f * (a + b), bc = 0.5f * (b + c), ca = 0.5f * (c + a);
        switch (d) {
            case 0:
                a = bc, b = ca, c = ab;
                break;
            case 1:
                b = ab, c = ca;
                break;
            case 2:
                a = ab, c = bc;
                break;
            default:
                a = ca, b = bc;
                break;
        }
    }
    // What is left is placed at random within the last sub-triangle.
    const uint64_t h = hashCombine(key.list, key.index, 2);
    float s = uniformFloat(h), q = uniformFloat(mixBits(h));
    if (s + q > 1.0f) s = 1.0f - s, q = 1.0f - q;
    const Vec2 uv = a + (b - a) * s + (c - a) * q;
    p.u = uv.x, p.v = uv.y;
    return p;
}

template MeshPoint meshPointAt(const std::vector<double>&, const MeshNode&, double,
                               const PointKey&);
template MeshPoint meshPointAt(const std::vector<float>&, const MeshNode&, double, const PointKey&);

InstancePoint instanceAt(const Scene& scene, const Group& group, uint32_t node_index,
                         double position) {
    const GroupNode* node = &group.nodes[node_index];
    const double total = node->area;
    double target = position * total;
    for (bool is_found = false; !is_found;) {
        is_found = true;
        double residents = node->area;
        for (uint32_t c = 0; c < node->child_count; ++c)
            residents -= group.nodes[node->first_child + c].area;
        if (node->child_count == 0 || target < residents) break;
        target -= residents;
        for (uint32_t c = 0; c < node->child_count; ++c) {
            const GroupNode& child = group.nodes[node->first_child + c];
            if (target < child.area || c + 1u == node->child_count) {
                node = &child;
                is_found = false;
                break;
            }
            target -= child.area;
        }
    }
    const uint32_t end = node->first + node->resident_count;
    for (uint32_t i = node->first;; ++i) {
        const ChildRef child = group.instances.child(i);
        const double area = childArea(scene, child) * group.instances.areaScale(i);
        if (target < area || i + 1 >= end)
            return {i, area > 0.0 ? std::clamp(target / area, 0.0, 0x1.fffffep-1) : 0.0,
                    area / std::max(total, 1e-300)};
        target -= area;
    }
}

}  // namespace stipple
