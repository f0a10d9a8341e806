// SPDX-License-Identifier: Apache-2.0
// An edited scene back to a scene file: rules stay rules, and what edits have changed stands beside
// them.
#pragma once

#include <scenegraph/scene.h>

#include <map>
#include <string>

namespace stipple {

// The scene's file with its "edits" replaced by what now differs from its rules, and with further
// assets: JSON by name (SceneEditor::addedAssets()); it loads to the
// same scene, names of instances included. path: in the folder of the scene's file, as paths in it
// are relative; written whole or not at all. Throws kInvalidArgument for scenes that are no scene
// file's, other folders, and where something that has no name in the file was placed; kIo.
void saveScene(const Scene& scene, const std::map<std::string, std::string>& assets,
               const std::string& path);

}  // namespace stipple
