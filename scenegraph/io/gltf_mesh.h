// SPDX-License-Identifier: Apache-2.0
// Meshes of a glTF file. Internal to the glTF loader.
#pragma once

#include <scenegraph/io/gltf_material.h>

namespace stipple {

// All triangles of meshes[index], primitives merged; a mesh without triangles if it has only points
// and lines (with a warning). Not yet built.
Mesh loadGltfMesh(const GltfDocument& document, int index, GltfMaterials& materials);

}  // namespace stipple
