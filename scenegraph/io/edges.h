// SPDX-License-Identifier: Apache-2.0
// Edges of a mesh and the triangles on both sides, whatever its vertices are split by.
#pragma once

#include <scenegraph/mesh.h>

#include <vector>

namespace stipple {

inline constexpr uint32_t kNoTriangle = 0xffffffffu;

struct SharedEdge {
    uint32_t from = 0, to = 0;  // places (placesOf()), from < to
    uint32_t a = 0;             // triangles on both sides
    uint32_t b = kNoTriangle;   // none: the mesh ends here
    float length = 0.0f;        // object space, m
};

// A number for each vertex: vertices at the same position share one, that of the first of them.
std::vector<uint32_t> placesOf(const Mesh& mesh);

// In the order of their places. Where more than two triangles meet, each two that follow each other
// share an edge. O(n log n).
std::vector<SharedEdge> sharedEdges(const Mesh& mesh);

}  // namespace stipple
