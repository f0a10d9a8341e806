// SPDX-License-Identifier: Apache-2.0
// The octree over a group's instances.
#pragma once

#include <scenegraph/scene.h>

namespace stipple {

// Builds nodes and sums of `group`; its children must be built. where: names the group in errors.
// The same bits for any number of threads. Throws kInvalidScene for a singular or non-finite
// transform. O(n log n).
void buildGroup(Scene& scene, Group& group, const std::string& where, ThreadPool& pool);

}  // namespace stipple
