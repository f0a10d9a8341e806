// SPDX-License-Identifier: Apache-2.0
#include <sampling/list_point.h>

#include <core/low_discrepancy.h>

#include <algorithm>

namespace stipple {

namespace {

// The index, bit-reversed. Sixteen points in a row fall into sixteen strata, in an order of their
// own: a run of one point may lie anywhere, wherever in the sequence it begins.
uint32_t reversedIndex(const PointKey& key) {
    const uint32_t order = uint32_t(hashCombine(key.list, key.index >> 4, 4)) << 28;
    return reverseBits(key.index) ^ order;
}

}  // namespace

double listPosition(const PointKey& key) {
    if (key.sampler == Sampler::kRandom) return uniformDouble(hashCombine(key.list, key.index));
    const double t = double(reversedIndex(key)) * 0x1p-32 + uniformDouble(key.list);
    return t - std::floor(t);
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

namespace {

double areaOf(const Scene& scene, const Group& group, uint32_t instance) {
    return childArea(scene, group.instances.child(instance)) * group.instances.areaScale(instance);
}

}  // namespace

InstancePoint instanceAt(const Scene& scene, const Group& group, uint32_t node_index,
                         double position) {
    const GroupNode* node = &group.nodes[node_index];
    double target = position * node->area;
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
        const double area = areaOf(scene, group, i);
        if (target < area || i + 1 >= end)
            return {i, area > 0.0 ? std::clamp(target / area, 0.0, 0x1.fffffep-1) : 0.0};
        target -= area;
    }
}

Branches::Branches(const Scene& scene, const Group& group, uint32_t node_index) {
    const GroupNode& node = group.nodes[node_index];
    for (uint32_t c = 0; c < node.child_count; ++c)
        area[c] = group.nodes[node.first_child + c].area;
    for (uint32_t i = node.first; i < node.first + node.resident_count; ++i)
        area[codeOfResident(group.listed_index[i])] += areaOf(scene, group, i);
    for (const double a : area) sum += a;
}

uint8_t Branches::at(double u) const {
    double target = u * sum;
    uint8_t last = 0;
    for (uint8_t code = 0; code < std::size(area); ++code) {
        if (!(area[code] > 0.0)) continue;
        last = code;
        if (target < area[code]) break;
        target -= area[code];
    }
    return last;
}

double WayNumbers::next() {
    const int dimension = dimension_++;
    if (dimension == 0) return listPosition(key_);
    if (dimension >= kSobolDimensions || key_.sampler == Sampler::kRandom)
        return uniformDouble(hashCombine(way_, key_.index, uint32_t(dimension), 4));
    const uint32_t x = sobol(dimension, reverseBits(reversedIndex(key_)));
    return double(owenScrambled(x, uint32_t(mixBits(way_)))) * 0x1p-32;
}

namespace {

// A reservoir of one: each takes the place of those before it with the share that it adds to them.
// From the last on, as the first of these to do so is the one. sum: of their areas.
uint32_t chooseResident(const Scene& scene, const Group& group, const GroupNode& node, uint8_t code,
                        double sum, const WayNumbers& way) {
    uint32_t chosen = node.first;
    for (uint32_t i = node.first + node.resident_count; i-- > node.first;) {
        const uint32_t listed = group.listed_index[i];
        if (Branches::codeOfResident(listed) != code) continue;
        const double area = areaOf(scene, group, i);
        if (!(area > 0.0)) continue;
        chosen = i;
        if (uniformDouble(way.hash(listed)) * sum < area) break;
        sum -= area;
    }
    return chosen;
}

}  // namespace

ChosenInstance chooseInstance(const Scene& scene, const Group& group, uint32_t node,
                              WayNumbers& way) {
    ChosenInstance result;
    for (bool is_first = true;; is_first = false) {
        const Branches branches(scene, group, node);
        const uint8_t code = branches.at(way.next());
        if (is_first) result.branch = code;
        if (!Branches::isChild(code)) {
            result.instance =
                chooseResident(scene, group, group.nodes[node], code, branches.area[code], way);
            way.goToInstance(group.listed_index[result.instance]);
            return result;
        }
        node = group.nodes[node].first_child + code;
        way.goToChild(node);
    }
}

}  // namespace stipple
