// SPDX-License-Identifier: Apache-2.0
// From a mesh or a scene in memory to a glTF file.
#pragma once

#include <core/material.h>
#include <scenegraph/scene.h>

#include <string>
#include <vector>

namespace stipple {

// Writes one node with the mesh: positions, normals, texture coordinates and vertex colours as they
// are there, one primitive a material (phong lobes become roughness; textures are left out). The
// mesh need not be built. The file appears whole or not at all. Throws kIo, kInvalidArgument if the
// mesh is empty or too large for the format (4 GB).
void saveGlb(const std::string& path, const Mesh& mesh, const std::vector<Material>& materials);

// Writes a whole built scene, as .glb or, by extension, as .gltf with everything in it: meshes,
// materials, textures, cameras, and lights as KHR_lights_punctual. Nested groups are flattened; the
// instances of a mesh stand in one node with EXT_mesh_gpu_instancing. Sky, haze and exposure have
// no place in glTF. Throws kUnsupported above kMostExportedInstances, else as saveGlb().
inline constexpr double kMostExportedInstances = 1e7;
void saveSceneGltf(const std::string& path, const Scene& scene);

}  // namespace stipple
