// SPDX-License-Identifier: Apache-2.0
// From a mesh in memory to a .glb file.
#pragma once

#include <core/material.h>
#include <scenegraph/mesh.h>

#include <string>
#include <vector>

namespace stipple {

// Writes one node with the mesh: positions, normals, texture coordinates and vertex colours as they
// are there, one primitive a material (phong lobes become roughness; textures are left out). The
// mesh need not be built. The file appears whole or not at all. Throws kIo, kInvalidArgument if the
// mesh is empty or too large for the format (4 GB).
void saveGlb(const std::string& path, const Mesh& mesh, const std::vector<Material>& materials);

}  // namespace stipple
