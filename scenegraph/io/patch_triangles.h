// SPDX-License-Identifier: Apache-2.0
// A patch's triangles at several densities, with the same border at all of them. Based on: Garland,
// Heckbert. Surface Simplification Using Quadric Error Metrics. 1997.
#pragma once

#include <scenegraph/hybrid_model.h>

namespace stipple {

// The triangles of the mesh as they are, then with about half as many each time, while that leaves
// out any worth mentioning. What has a colour or texture that varies over it keeps its triangles.
std::vector<TriangleLevel> simplifyPatch(const Mesh& mesh, const std::vector<Material>& materials,
                                         const std::vector<uint32_t>& triangles);

}  // namespace stipple
