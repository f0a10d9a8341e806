// SPDX-License-Identifier: Apache-2.0
// An asset that comes while the scene is looked at.
#pragma once

#include <core/parallel.h>
#include <scenegraph/io/load.h>
#include <scenegraph/scene.h>

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace stipple {

struct NewAsset {
    Scene scene;  // built; has the asset alone, for SceneEditor::addAsset()
    ChildRef child;
};

// Loads or makes what `asset` says, an entry of a scene file's "assets". scene_path: the scene that
// it will be added to; files are looked for in its folder. Throws as loadScene() does, with a JSON
// pointer into `asset` or the name of the asset's file.
NewAsset loadNewAsset(const std::string& scene_path, const std::string& name,
                      const nlohmann::json& asset, const LoadOptions& options, ThreadPool& pool,
                      Diagnostics& diagnostics);

}  // namespace stipple
