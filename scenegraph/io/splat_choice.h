// SPDX-License-Identifier: Apache-2.0
// Few splats that cover all points of a cloud: greedy, then without those whose points others
// cover. Based on: Wu, Kobbelt. Optimized Sub-Sampling of Point Sets for Surface Splatting. 2004.
#pragma once

#include <core/parallel.h>
#include <scenegraph/io/splat_grow.h>

#include <functional>

namespace stipple {

inline constexpr size_t kMostCovered = 1024;  // points, about: flat places would take n^2 time

// The points that a splat covers.
void findCovered(const Splat& splat, const SplatPoints& points, const PointIndex& index,
                 const SplatRules& rules, std::vector<uint32_t>& covered);

struct ChosenSplat {
    Splat splat;
    std::vector<uint32_t> covered;  // points; its own first
};

// Of points that have normals. relax: leave out splats whose points others cover. The same for any
// number of threads. Throws kCancelled. O(n log n), some 100 bytes a point.
std::vector<ChosenSplat> chooseSplats(const SplatPoints& points, const PointIndex& index,
                                      const SplatRules& rules, bool relax, ThreadPool& pool,
                                      const CancelFlag& cancel,
                                      const std::function<void(double fraction)>& progress);

// One splat a point, as wide as the points are apart.
std::vector<ChosenSplat> splatEachPoint(const SplatPoints& points);

}  // namespace stipple
