// SPDX-License-Identifier: Apache-2.0
// Model files (.gltf, .glb, .ply, .obj, .stipple) within the loading of a scene.
#pragma once

#include <scenegraph/io/load_context.h>

#include <filesystem>
#include <string>

namespace stipple {

// By the extension, in any case.
bool isModelFile(const std::filesystem::path& path);
inline constexpr const char* kModelExtensions = ".gltf, .glb, .ply, .obj or .stipple";

// Adds what the file shows to the scene and returns the child to instance: a mesh, or a group.
// name: how errors call the file. Throws as loadScene() does.
ChildRef loadModel(const std::filesystem::path& path, const std::string& name, Scene& scene,
                   LoadContext& context);

// PLY of all three encodings: faces and triangle strips as a mesh, vertices alone as a point cloud
// of discs (point_discs.h). Double-sided; colours are taken as sRGB.
ChildRef loadPly(const std::filesystem::path& path, const std::string& name, Scene& scene,
                 LoadContext& context);

// Wavefront OBJ with the materials and textures of its MTL files; vertices without any face as a
// point cloud. Double-sided. What the MTL files lack is a warning.
ChildRef loadObj(const std::filesystem::path& path, const std::string& name, Scene& scene,
                 LoadContext& context);

// A group that shows nothing.
ChildRef addEmptyGroup(Scene& scene, const std::string& name);

// Adds mesh and materials; triangle_material counts from the first of `materials`. A mesh without
// triangles becomes an empty group. Throws kUnsupported for more than 65536 materials.
ChildRef addModel(Scene& scene, Mesh mesh, std::vector<Material> materials,
                  const std::string& where);

}  // namespace stipple
