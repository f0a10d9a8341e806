// SPDX-License-Identifier: Apache-2.0
// Edit scripts: one JSON object a line, `"do"` says what.
#pragma once

#include <core/camera.h>
#include <core/math.h>
#include <scenegraph/scene_editor.h>

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

namespace stipple {

// What an edit leaves for later lines: labels ("as"), and what "restore" brings back.
struct EditMemory {
    std::map<std::string, InstanceId> labels;
    std::map<std::pair<uint32_t, uint32_t>, std::pair<ChildRef, Affine>> removed;
};

// Does insert, remove, move, replace or restore; false for other commands. Returns what was edited
// in `edited`. Throws kInvalidScene with the key at fault, and then nothing has changed.
bool runEdit(const nlohmann::json& command, SceneEditor& editor, EditMemory& memory,
             InstanceId& edited);

// The name and the description of what "asset" adds: the command's other keys.
std::pair<std::string, nlohmann::json> assetOf(const nlohmann::json& command, const Scene& scene);

// The camera that "camera" sets: one of the scene by its name, or a new one.
Camera cameraOf(const nlohmann::json& command, const Scene& scene);

// Refuses keys other than these and `do`.
void checkKeys(const nlohmann::json& command, std::initializer_list<const char*> known);
// A member that must be a string; `none` where it may be missing.
std::string stringOf(const nlohmann::json& command, const char* key,
                     const std::optional<std::string>& none = {});

}  // namespace stipple
