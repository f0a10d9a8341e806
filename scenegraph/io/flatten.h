// SPDX-License-Identifier: Apache-2.0
// From a scene to one mesh of all that it shows.
#pragma once

#include <scenegraph/scene.h>

namespace stipple {

// The triangles of all instances below the root, in world space, with materials of the scene's; not
// built. Normals, texture coordinates and colours are there if any mesh has them. Throws
// kInvalidScene if there are none, kUnsupported for more than 2^26 of them, kCancelled.
Mesh flattenScene(const Scene& scene, const CancelFlag& cancel);

}  // namespace stipple
