// SPDX-License-Identifier: Apache-2.0
// MTL files, through tinyobjloader. Internal to the OBJ loader.
#pragma once

#include <scenegraph/io/load_context.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace stipple {

// The materials of one model by the names that its MTL files give them.
struct ObjMaterials {
    std::vector<Material> materials;  // the first is for faces without one
    std::map<std::string, uint16_t> by_name;
};

// Reads an MTL file and adds its materials. A picture that is missing or cannot be read is a
// warning. Throws kFileNotFound, kInvalidScene for what lies outside of the scene's folder,
// kUnsupported for more than 65535 materials.
void readMtl(const std::filesystem::path& folder, const std::string& file, Scene& scene,
             LoadContext& context, const std::string& where, ObjMaterials& out);

}  // namespace stipple
