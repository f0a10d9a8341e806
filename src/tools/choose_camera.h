// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <scenegraph/scene.h>

#include <string>

namespace stipple {

// The camera of that name, the first for "". where: what gave the name, for errors. Throws
// kInvalidArgument listing those there are, kInvalidScene if there are none.
const Camera& chooseCamera(const Scene& scene, const std::string& name,
                           const std::string& where = "--camera");

}  // namespace stipple
