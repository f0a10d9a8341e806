// SPDX-License-Identifier: Apache-2.0
// From what a picture shows at a place back to the instance.
#pragma once

#include <scenegraph/scene.h>

#include <cstdint>
#include <vector>

namespace stipple {

// The names (Group::listed_index) from the root down to the instance that a picture shows at a
// point (world), found within its bounds; empty if there is none. object: as the channel of that
// name has it, the lower 24 bits of the object id. tolerance: metres, of the point. O(what has the
// point in its bounds).
std::vector<uint32_t> pathOfObject(const Scene& scene, uint32_t object, const DVec3& point,
                                   double tolerance);

}  // namespace stipple
