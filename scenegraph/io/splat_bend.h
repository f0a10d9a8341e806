// SPDX-License-Identifier: Apache-2.0
// How the normal turns over a splat: a linear field, fitted to the normals of the points that it
// covers, so that splats look as smooth as what they stand for. Based on: Botsch, Spernat, Kobbelt.
// Phong Splatting. 2004.
#pragma once

#include <scenegraph/io/splat_grow.h>

namespace stipple {

// Sets the splat's shading normal and bend, of at least six points; fewer leave it flat.
// O(points covered).
void bendNormals(const SplatPoints& points, const std::vector<uint32_t>& covered, Splat& splat);

}  // namespace stipple
