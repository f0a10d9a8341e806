// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/model.h>

#include <scenegraph/io/gltf.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/surfel_file.h>

#include <limits>

namespace stipple {

namespace {

std::string extensionOf(const std::filesystem::path& path) {
    std::string extension = path.extension().string();
    for (char& c : extension) c = char(std::tolower(uint8_t(c)));
    return extension;
}

}  // namespace

bool isModelFile(const std::filesystem::path& path) {
    const std::string extension = extensionOf(path);
    return extension == ".gltf" || extension == ".glb" || extension == ".ply" ||
           extension == ".obj" || extension == ".stipple";
}

ChildRef loadModel(const std::filesystem::path& path, const std::string& name, Scene& scene,
                   LoadContext& context) {
    context.throwIfCancelled();
    const std::string extension = extensionOf(path);
    if (extension == ".ply") return loadPly(path, name, scene, context);
    if (extension == ".stipple") return loadSurfelModel(path, name, scene, context);
    if (extension == ".obj") return loadObj(path, name, scene, context);
    return loadGltf(path, name, scene, context);
}

ChildRef addEmptyGroup(Scene& scene, const std::string& name) {
    Group group;
    group.name = name;
    scene.groups.push_back(std::move(group));
    return ChildRef::group(uint32_t(scene.groups.size() - 1));
}

ChildRef addModel(Scene& scene, Mesh mesh, std::vector<Material> materials,
                  const std::string& where) {
    if (mesh.triangles.empty()) return addEmptyGroup(scene, mesh.name);
    const size_t first = scene.materials.size();
    if (first + materials.size() > size_t(std::numeric_limits<uint16_t>::max()) + 1) {
        throw Error(ErrorCode::kUnsupported, where, "the scene has more than 65536 materials");
    }
    for (uint16_t& material : mesh.triangle_material) material = uint16_t(material + first);
    for (Material& material : materials) scene.materials.push_back(std::move(material));
    scene.meshes.push_back(std::move(mesh));
    return ChildRef::mesh(uint32_t(scene.meshes.size() - 1));
}

}  // namespace stipple
