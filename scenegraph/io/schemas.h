// SPDX-License-Identifier: Apache-2.0
// The texts of the JSON Schemas, put into the binary when it is built (from schemas.cpp.in).
#pragma once

namespace stipple {

extern const char* const kSceneSchemaText;  // scenes/scene.schema.json: the scene file, published
extern const char* const
    kGltfSchemaText;  // scenegraph/io/gltf.schema.json: what loadGltf reads of a glTF document

}  // namespace stipple
