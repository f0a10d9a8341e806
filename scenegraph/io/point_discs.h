// SPDX-License-Identifier: Apache-2.0
// Point clouds as surfaces: every point becomes a small square that stands for the disc it samples,
// so that points, z-buffer and rays all draw the same. Based on: Pfister, Zwicker, van Baar, Gross.
// Surfels: Surface Elements as Rendering Primitives. 2000 (points as oriented discs).
#pragma once

#include <scenegraph/io/load_context.h>
#include <scenegraph/mesh.h>

#include <string>
#include <vector>

namespace stipple {

struct PointDiscs {
    std::vector<uint32_t> point;   // the point that each disc stands for; ascending
    std::vector<Vec3> corners;     // four a disc
    std::vector<UVec3> triangles;  // two a disc, indices into corners
};

// Discs that face `normals` (as many as positions; null vectors and empty: estimated from the 12
// nearest neighbours) and have the area of a circle whose radius is the mean distance to the six
// nearest neighbours, but at most 4 x and at least 1/10 of the median. Points that are not finite
// are left out, and of those at the very same place all but the first; warnings say how many.
// Throws kOutOfMemory, kCancelled. Deterministic for any thread count. O(n log n).
PointDiscs makePointDiscs(const std::vector<Vec3>& positions, const std::vector<Vec3>& normals,
                          LoadContext& context, const std::string& where);

// One value a disc's corner from one a point; empty stays empty.
template <class V>
std::vector<V> perCorner(const PointDiscs& discs, const std::vector<V>& values) {
    std::vector<V> result;
    if (values.empty()) return result;
    result.reserve(discs.point.size() * 4);
    for (const uint32_t point : discs.point) result.insert(result.end(), 4, values[point]);
    return result;
}

}  // namespace stipple
