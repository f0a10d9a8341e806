// SPDX-License-Identifier: Apache-2.0
#include <core/image.h>
#include <scenegraph/io/gltf_writer.h>

#include <tiny_gltf.h>

#include <cstring>
#include <map>
#include <sstream>

namespace stipple {

namespace {

using Numbers = std::vector<double>;

tinygltf::Value numberValue(double number) { return tinygltf::Value(number); }

tinygltf::Value colorValue(const Vec3& color) {
    tinygltf::Value::Array array;
    for (int i = 0; i < 3; ++i) array.push_back(numberValue(color[i]));
    return tinygltf::Value(std::move(array));
}

void addExtension(tinygltf::Model& model, tinygltf::Material& target, const std::string& name,
                  tinygltf::Value::Object members) {
    target.extensions[name] = tinygltf::Value(std::move(members));
    auto& used = model.extensionsUsed;
    if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
}

void addMaterial(tinygltf::Model& model, const Material& material) {
    tinygltf::Material& target = model.materials.emplace_back();
    target.name = material.name;
    const Vec3& color = material.base_color;
    target.pbrMetallicRoughness.baseColorFactor =
        Numbers{color.x, color.y, color.z, material.alpha};
    target.pbrMetallicRoughness.metallicFactor = 0.0;
    // Blinn-Phong's exponent n as microfacet roughness: n = 2 / roughness^4 - 2.
    target.pbrMetallicRoughness.roughnessFactor =
        std::pow(2.0 / (2.0 + std::max(0.0f, material.shininess)), 0.25);
    target.doubleSided = material.double_sided;
    if (material.alpha_mode == AlphaMode::kMask) target.alphaMode = "MASK";
    if (material.alpha_mode == AlphaMode::kBlend) target.alphaMode = "BLEND";
    target.alphaCutoff = material.alpha_cutoff;
    const Vec3& emissive = material.emissive;
    target.emissiveFactor = Numbers{emissive.x, emissive.y, emissive.z};

    constexpr float kPlainReflectance = 0.04f;  // what glTF gives to a dielectric
    addExtension(model, target, "KHR_materials_specular",
                 {{"specularColorFactor", colorValue(material.specular / kPlainReflectance)}});
    if (material.translucency > 0.0f) {
        addExtension(model, target, "KHR_materials_diffuse_transmission",
                     {{"diffuseTransmissionFactor", numberValue(material.translucency)}});
    }
    if (material.unlit) addExtension(model, target, "KHR_materials_unlit", {});
}

// Appends the array to the file's one buffer and returns the index of an accessor for it.
template <class T>
int addAccessor(tinygltf::Model& model, const std::vector<T>& values, int type, int component_type,
                size_t count, int target) {
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = model.buffers[0].data.size();
    view.byteLength = values.size() * sizeof(T);
    view.target = target;
    model.buffers[0].data.resize(view.byteOffset + view.byteLength);
    std::memcpy(model.buffers[0].data.data() + view.byteOffset, values.data(), view.byteLength);
    model.bufferViews.push_back(view);

    tinygltf::Accessor accessor;
    accessor.bufferView = int(model.bufferViews.size()) - 1;
    accessor.type = type;
    accessor.componentType = component_type;
    accessor.count = count;
    model.accessors.push_back(accessor);
    return int(model.accessors.size()) - 1;
}

template <class T>
int addVertexData(tinygltf::Model& model, const std::vector<T>& values, int type) {
    return addAccessor(model, values, type, TINYGLTF_COMPONENT_TYPE_FLOAT, values.size(),
                       TINYGLTF_TARGET_ARRAY_BUFFER);
}

std::map<std::string, int> addVertices(tinygltf::Model& model, const Mesh& mesh) {
    std::map<std::string, int> attributes;
    attributes["POSITION"] = addVertexData(model, mesh.positions, TINYGLTF_TYPE_VEC3);
    Box3 bounds;
    for (const Vec3& p : mesh.positions) bounds.extend(p);
    tinygltf::Accessor& positions = model.accessors.back();
    positions.minValues = Numbers{bounds.min.x, bounds.min.y, bounds.min.z};
    positions.maxValues = Numbers{bounds.max.x, bounds.max.y, bounds.max.z};
    if (!mesh.normals.empty())
        attributes["NORMAL"] = addVertexData(model, mesh.normals, TINYGLTF_TYPE_VEC3);
    if (!mesh.uvs.empty())
        attributes["TEXCOORD_0"] = addVertexData(model, mesh.uvs, TINYGLTF_TYPE_VEC2);
    if (!mesh.colors.empty())
        attributes["COLOR_0"] = addVertexData(model, mesh.colors, TINYGLTF_TYPE_VEC4);
    return attributes;
}

size_t fileBytes(const Mesh& mesh) {
    return mesh.positions.size() * sizeof(Vec3) + mesh.normals.size() * sizeof(Vec3) +
           mesh.uvs.size() * sizeof(Vec2) + mesh.colors.size() * sizeof(Vec4) +
           mesh.triangles.size() * sizeof(UVec3);
}

}  // namespace

void saveGlb(const std::string& path, const Mesh& mesh, const std::vector<Material>& materials) {
    constexpr size_t kMostBytes = 0xff000000u;  // the format counts bytes in 32 bits
    if (mesh.triangles.empty())
        throw Error(ErrorCode::kInvalidArgument, path, "the mesh has no triangles");
    if (fileBytes(mesh) > kMostBytes)
        throw Error(ErrorCode::kInvalidArgument, path, "the mesh is too large for a .glb");

    tinygltf::Model model;
    model.asset.version = "2.0";
    model.asset.generator = "stipple";
    model.buffers.emplace_back();
    for (const Material& material : materials) addMaterial(model, material);

    std::map<uint16_t, std::vector<UVec3>> triangles_by_material;
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
        triangles_by_material[mesh.triangle_material[i]].push_back(mesh.triangles[i]);
    }
    tinygltf::Mesh& target = model.meshes.emplace_back();
    target.name = mesh.name;
    const std::map<std::string, int> attributes = addVertices(model, mesh);
    for (const auto& [material, triangles] : triangles_by_material) {
        tinygltf::Primitive& primitive = target.primitives.emplace_back();
        primitive.attributes = attributes;
        primitive.material = material;
        primitive.mode = TINYGLTF_MODE_TRIANGLES;
        primitive.indices = addAccessor(model, triangles, TINYGLTF_TYPE_SCALAR,
                                        TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, triangles.size() * 3,
                                        TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    }
    tinygltf::Node& node = model.nodes.emplace_back();
    node.name = mesh.name;
    node.mesh = 0;
    model.scenes.emplace_back().nodes.push_back(0);
    model.defaultScene = 0;

    std::ostringstream stream;
    if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, false, true)) {
        throw Error(ErrorCode::kInternal, path, "could not be encoded as glTF");
    }
    saveFile(path, stream.str());
}

}  // namespace stipple
