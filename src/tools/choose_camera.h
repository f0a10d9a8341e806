// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <scenegraph/scene.h>

#include <string>

namespace stipple {

// The camera of that name, as --camera gave it; the first for "". Throws kInvalidArgument listing
// those there are, kInvalidScene if there are none.
const Camera& chooseCamera(const Scene& scene, const std::string& name);

}  // namespace stipple
