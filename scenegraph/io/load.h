// SPDX-License-Identifier: Apache-2.0
// From files to a built scene: the scene file (*.scene.json) and single models (.gltf, .glb, .ply,
// .obj).
#pragma once

#include <core/error.h>
#include <core/parallel.h>
#include <scenegraph/scene.h>

#include <cstdint>
#include <string>

namespace stipple {

struct LoadOptions {
    bool allow_outside = false;  // let paths leave the scene file's folder
    uint64_t memory_limit_mb =
        0;  // 0: no limit but the machine's; checked before large allocations
    const CancelFlag* cancel = nullptr;
};

// Loads by extension and builds the scene (buildScene). A single asset gets a root group, a camera
// named "default" and the default light. Throws Error: kFileNotFound, kParse (with line and column
// of a JSON error), kInvalidScene (with JSON pointer), kUnsupported, kOutOfMemory, kCancelled.
Scene loadScene(const std::string& path, const LoadOptions& options, ThreadPool& pool,
                Diagnostics& diagnostics);

// Adds what the file's default scene shows to `scene`: its materials, textures and meshes (one Mesh
// a glTF mesh, all primitives merged), and a new group with one instance a mesh node (nested nodes
// are flattened into transforms, EXT_mesh_gpu_instancing into instances). Returns the child to
// instance: that group, or the mesh itself where the group would hold one untransformed instance.
// Cameras and lights of the file are added to the scene's. Throws as above.
ChildRef loadGltf(const std::string& path, Scene& scene, const LoadOptions& options,
                  Diagnostics& diagnostics);

}  // namespace stipple
