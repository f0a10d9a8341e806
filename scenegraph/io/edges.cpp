// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/edges.h>

#include <core/rng.h>

#include <algorithm>
#include <bit>
#include <tuple>
#include <unordered_map>

namespace stipple {

namespace {

struct PositionHash {
    size_t operator()(const Vec3& p) const {
        const auto bits = [](float v) { return std::bit_cast<uint32_t>(v == 0.0f ? 0.0f : v); };
        return size_t(hashCombine(uint64_t(bits(p.x)) << 32 | bits(p.y), bits(p.z)));
    }
};

}  // namespace

std::vector<uint32_t> placesOf(const Mesh& mesh) {
    std::unordered_map<Vec3, uint32_t, PositionHash> first;
    first.reserve(mesh.positions.size());
    std::vector<uint32_t> places(mesh.positions.size());
    for (uint32_t i = 0; i < places.size(); ++i)
        places[i] = first.emplace(mesh.positions[i], i).first->second;
    return places;
}

std::vector<SharedEdge> sharedEdges(const Mesh& mesh) {
    const std::vector<uint32_t> places = placesOf(mesh);
    std::vector<SharedEdge> sides;
    sides.reserve(mesh.triangles.size() * 3);
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        for (int k = 0; k < 3; ++k) {
            const uint32_t p = places[mesh.triangles[t][k]],
                           q = places[mesh.triangles[t][(k + 1) % 3]];
            if (p == q) continue;
            const float length = glm::length(mesh.positions[p] - mesh.positions[q]);
            sides.push_back({std::min(p, q), std::max(p, q), t, kNoTriangle, length});
        }
    }
    std::sort(sides.begin(), sides.end(), [](const SharedEdge& x, const SharedEdge& y) {
        return std::tie(x.from, x.to, x.a) < std::tie(y.from, y.to, y.a);
    });
    std::vector<SharedEdge> edges;
    for (size_t i = 0; i < sides.size();) {
        size_t end = i + 1;
        while (end < sides.size() && sides[end].from == sides[i].from &&
               sides[end].to == sides[i].to)
            ++end;
        if (end == i + 1) edges.push_back(sides[i]);
        for (size_t k = i; k + 1 < end; ++k) {
            edges.push_back(sides[k]);
            edges.back().b = sides[k + 1].a;
        }
        i = end;
    }
    return edges;
}

}  // namespace stipple
