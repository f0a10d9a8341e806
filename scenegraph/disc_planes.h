// SPDX-License-Identifier: Apache-2.0
// The planes of surfels' discs, of where the surfels around them lie: a surfel has but a shading
// normal, and where that is not the surface's (smoothed over few triangles) discs that stand in its
// plane would let one look between them.
#pragma once

#include <scenegraph/surfel_model.h>

namespace stipple {

// Unit normals of the planes through a block's surfels (at most kBlockSurfels) and those around
// them, on the side of the shading normals; these where there are not enough around, or on a line
// (a twig). Object space. O(count^2), about 2 us.
void discPlanes(float spacing, const Surfel* surfels, int count, Vec3* normals);

}  // namespace stipple
