// SPDX-License-Identifier: Apache-2.0
// KHR_lights_punctual. Internal to the glTF loader.
#pragma once

#include <core/light.h>
#include <scenegraph/io/gltf_document.h>

namespace stipple {

// Adds the light that a node's extension names, where the node stands (scale means nothing to
// lights). lux and candela are taken as they are: irradiance and intensity. path: of the extension.
void addGltfLight(const GltfDocument& document, const tinygltf::Value& extension,
                  const Affine& world_from_node, const std::string& path, Lighting& lighting);

}  // namespace stipple
