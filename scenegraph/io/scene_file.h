// SPDX-License-Identifier: Apache-2.0
// The scene file (*.scene.json): see scenes/scene.schema.json for its format.
#pragma once

#include <scenegraph/io/load_context.h>

namespace stipple {

// Reads the file and everything it names. The scene is not yet built and has the file's cameras
// only. name: how errors call the file. Throws Error with a JSON pointer.
Scene readSceneFile(const std::filesystem::path& path, const std::string& name,
                    LoadContext& context, ThreadPool& pool);

}  // namespace stipple
