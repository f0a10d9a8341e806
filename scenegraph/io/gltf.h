// SPDX-License-Identifier: Apache-2.0
// loadGltf() within the loading of a larger scene.
#pragma once

#include <scenegraph/io/load_context.h>

namespace stipple {

// As loadGltf() of load.h, with the folder, the memory budget and the warnings of the whole. name:
// how errors call the file.
ChildRef loadGltf(const std::filesystem::path& path, const std::string& name, Scene& scene,
                  LoadContext& context);

}  // namespace stipple
