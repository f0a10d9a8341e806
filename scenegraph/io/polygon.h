// SPDX-License-Identifier: Apache-2.0
// Polygons of files as triangles.
#pragma once

#include <core/math.h>

#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

// Appends the triangles of a polygon (indices into positions, in range), concave ones by clipping
// ears; a polygon that cuts itself, or has more than 1000 corners, becomes a fan. n corners make
// n - 2 triangles; fewer than 3 make none. O(n^2).
void triangulatePolygon(const std::vector<Vec3>& positions, std::span<const uint32_t> polygon,
                        std::vector<UVec3>& triangles);

}  // namespace stipple
