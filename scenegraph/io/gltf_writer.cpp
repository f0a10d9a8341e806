// SPDX-License-Identifier: Apache-2.0
#include <core/image.h>
#include <scenegraph/io/gltf_writer.h>
#include <scenegraph/io/picture.h>

#include <tiny_gltf.h>
#include <Eigen/Dense>
#define GLM_ENABLE_EXPERIMENTAL
#include <glm/gtc/quaternion.hpp>
#include <glm/gtx/quaternion.hpp>

#include <cstring>
#include <functional>
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

void addOnce(std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

// target: a material or a node.
template <class T>
void addExtension(tinygltf::Model& model, T& target, const std::string& name,
                  tinygltf::Value::Object members) {
    target.extensions[name] = tinygltf::Value(std::move(members));
    addOnce(model.extensionsUsed, name);
}

// Info: any kind of texture info. Textures and layers of coordinates have the scene's numbers.
template <class Info>
void setTexture(Info& info, const TextureUse& use) {
    info.index = use.texture;
    if (use.texture != kNoTexture) info.texCoord = use.uv_layer;
}

tinygltf::Value textureValue(const TextureUse& use) {
    return tinygltf::Value(tinygltf::Value::Object{{"index", tinygltf::Value(use.texture)},
                                                   {"texCoord", tinygltf::Value(use.uv_layer)}});
}

void addMaterial(tinygltf::Model& model, const Material& material) {
    tinygltf::Material& target = model.materials.emplace_back();
    target.name = material.name;
    const Vec3& color = material.base_color;
    target.pbrMetallicRoughness.baseColorFactor =
        Numbers{color.x, color.y, color.z, material.alpha};
    target.pbrMetallicRoughness.metallicFactor = material.metallic;
    target.pbrMetallicRoughness.roughnessFactor = material.roughness;
    target.doubleSided = material.double_sided;
    if (material.alpha_mode == AlphaMode::kMask) target.alphaMode = "MASK";
    if (material.alpha_mode == AlphaMode::kBlend) target.alphaMode = "BLEND";
    if (material.alpha_mode == AlphaMode::kMask) target.alphaCutoff = material.alpha_cutoff;
    if (material.base_texture != kNoTexture)
        target.pbrMetallicRoughness.baseColorTexture.index = material.base_texture;
    // Factors reach to 1.
    const Vec3& e = material.emissive;
    const float strength = std::max({e.x, e.y, e.z, 1.0f});
    target.emissiveFactor = Numbers{e.x / strength, e.y / strength, e.z / strength};
    if (strength > 1.0f) {
        addExtension(model, target, "KHR_materials_emissive_strength",
                     {{"emissiveStrength", numberValue(strength)}});
    }

    setTexture(target.normalTexture, material.normal_map);
    target.normalTexture.scale = material.normal_scale;
    setTexture(target.pbrMetallicRoughness.metallicRoughnessTexture,
               material.metallic_roughness_map);
    setTexture(target.emissiveTexture, material.emissive_map);

    constexpr float kPlainReflectance = 0.04f;  // what glTF gives to a dielectric
    tinygltf::Value::Object specular = {
        {"specularFactor", numberValue(material.specular_weight)},
        {"specularColorFactor", colorValue(material.specular / kPlainReflectance)}};
    if (material.specular_map.texture != kNoTexture)
        specular["specularTexture"] = textureValue(material.specular_map);
    if (material.specular_color_map.texture != kNoTexture)
        specular["specularColorTexture"] = textureValue(material.specular_color_map);
    addExtension(model, target, "KHR_materials_specular", std::move(specular));
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
    for (size_t i = 0; i < mesh.more_uvs.size() && !mesh.uvs.empty(); ++i) {
        attributes["TEXCOORD_" + std::to_string(i + 1)] =
            addVertexData(model, mesh.more_uvs[i], TINYGLTF_TYPE_VEC2);
    }
    if (!mesh.colors.empty())
        attributes["COLOR_0"] = addVertexData(model, mesh.colors, TINYGLTF_TYPE_VEC4);
    return attributes;
}

size_t fileBytes(const Mesh& mesh) {
    return mesh.positions.size() * sizeof(Vec3) + mesh.normals.size() * sizeof(Vec3) +
           mesh.uvs.size() * sizeof(Vec2) * (1 + mesh.more_uvs.size()) +
           mesh.colors.size() * sizeof(Vec4) + mesh.triangles.size() * sizeof(UVec3);
}

// One primitive a material. Returns the mesh's index.
int addMesh(tinygltf::Model& model, const Mesh& mesh) {
    std::map<uint16_t, std::vector<UVec3>> triangles_by_material;
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
        triangles_by_material[mesh.triangle_material[i]].push_back(mesh.triangles[i]);
    }
    const std::map<std::string, int> attributes = addVertices(model, mesh);
    tinygltf::Mesh& target = model.meshes.emplace_back();
    target.name = mesh.name;
    for (const auto& [material, triangles] : triangles_by_material) {
        tinygltf::Primitive& primitive = target.primitives.emplace_back();
        primitive.attributes = attributes;
        primitive.material = material;
        primitive.mode = TINYGLTF_MODE_TRIANGLES;
        primitive.indices = addAccessor(model, triangles, TINYGLTF_TYPE_SCALAR,
                                        TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, triangles.size() * 3,
                                        TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    }
    return int(model.meshes.size()) - 1;
}

int wrapOf(Wrap wrap) {
    return wrap == Wrap::kClamp    ? TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE
           : wrap == Wrap::kMirror ? TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT
                                   : TINYGLTF_TEXTURE_WRAP_REPEAT;
}

void addTexture(tinygltf::Model& model, const Texture& texture) {
    const std::string png = encodePng(texture.levels.at(0));
    std::vector<unsigned char>& data = model.buffers[0].data;
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = data.size();
    view.byteLength = png.size();
    data.insert(data.end(), png.begin(), png.end());
    data.resize((data.size() + 3) / 4 * 4);  // what follows are floats
    model.bufferViews.push_back(view);
    tinygltf::Image image;
    image.name = texture.name;
    image.mimeType = "image/png";
    image.bufferView = int(model.bufferViews.size()) - 1;
    model.images.push_back(image);
    tinygltf::Sampler sampler;
    sampler.wrapS = wrapOf(texture.wrap_u), sampler.wrapT = wrapOf(texture.wrap_v);
    if (texture.nearest) sampler.magFilter = TINYGLTF_TEXTURE_FILTER_NEAREST;
    model.samplers.push_back(sampler);
    tinygltf::Texture target;
    target.source = int(model.images.size()) - 1;
    target.sampler = int(model.samplers.size()) - 1;
    model.textures.push_back(target);
}

Numbers numbersOf(const DVec3& v) { return {v.x, v.y, v.z}; }
Numbers numbersOf(const glm::dquat& q) { return {q.x, q.y, q.z, q.w}; }

int addNode(tinygltf::Model& model, tinygltf::Node node, bool is_root = true) {
    model.nodes.push_back(std::move(node));
    const int index = int(model.nodes.size()) - 1;
    if (is_root) model.scenes[0].nodes.push_back(index);
    return index;
}

struct Parts {
    DVec3 translation;
    glm::dquat rotation;
    DVec3 scale;
};

// translation * rotation * scale, if the transform is such.
bool decompose(const Affine& a, Parts& parts) {
    const DVec3 length(glm::length(a.linear[0]), glm::length(a.linear[1]),
                       glm::length(a.linear[2]));
    DMat3 r(a.linear[0] / length.x, a.linear[1] / length.y, a.linear[2] / length.z);
    constexpr double kTolerance = 1e-5;
    if (std::abs(glm::dot(r[0], r[1])) > kTolerance ||
        std::abs(glm::dot(r[0], r[2])) > kTolerance ||
        std::abs(glm::dot(r[1], r[2])) > kTolerance) {
        return false;
    }
    const double side = glm::determinant(r) < 0.0 ? -1.0 : 1.0;  // mirrored
    r = r * side;
    parts = {a.translation, glm::normalize(glm::quat_cast(r)), length * side};
    return true;
}

DMat3 fromEigen(const Eigen::MatrixXd& m) {
    DMat3 result;
    for (int c = 0; c < 3; ++c) result[c] = DVec3(m(0, c), m(1, c), m(2, c));
    return result;
}

// A sheared transform takes two nodes: rotation, scale, rotation (a singular value decomposition).
void addShearedNode(tinygltf::Model& model, int mesh, const Affine& a) {
    Eigen::MatrixXd m(3, 3);
    for (int c = 0; c < 3; ++c) m.col(c) << a.linear[c].x, a.linear[c].y, a.linear[c].z;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double side_u = svd.matrixU().determinant(), side_v = svd.matrixV().determinant();
    const DMat3 u = fromEigen(svd.matrixU() * side_u), v = fromEigen(svd.matrixV() * side_v);
    const Eigen::VectorXd s = svd.singularValues() * (side_u * side_v);
    tinygltf::Node inner, outer;
    inner.mesh = mesh;
    inner.rotation = numbersOf(glm::normalize(glm::quat_cast(glm::transpose(v))));
    outer.translation = numbersOf(a.translation);
    outer.rotation = numbersOf(glm::normalize(glm::quat_cast(u)));
    outer.scale = {s(0), s(1), s(2)};
    outer.children.push_back(addNode(model, std::move(inner), false));
    addNode(model, std::move(outer));
}

// The nodes of all instances of a mesh.
void addInstances(tinygltf::Model& model, int mesh, const std::string& name,
                  const std::vector<Affine>& instances) {
    std::vector<Parts> all;
    DBox3 box;
    for (const Affine& a : instances) {
        Parts parts;
        if (decompose(a, parts)) {
            all.push_back(parts);
            box.extend(parts.translation);
        } else {
            addShearedNode(model, mesh, a);
        }
    }
    if (all.empty()) return;
    tinygltf::Node node;
    node.name = name;
    node.mesh = mesh;
    if (all.size() == 1) {
        node.translation = numbersOf(all[0].translation);
        node.rotation = numbersOf(all[0].rotation);
        node.scale = numbersOf(all[0].scale);
        addNode(model, std::move(node));
        return;
    }
    // Floats count from the middle: they are finer there.
    const DVec3 middle = box.center();
    std::vector<Vec3> translations, scales;
    std::vector<Vec4> rotations;
    for (const Parts& p : all) {
        translations.push_back(Vec3(p.translation - middle));
        rotations.push_back(Vec4(p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.w));
        scales.push_back(Vec3(p.scale));
    }
    const auto accessor = [&](const auto& values, int type) {
        return tinygltf::Value(
            addAccessor(model, values, type, TINYGLTF_COMPONENT_TYPE_FLOAT, values.size(), 0));
    };
    tinygltf::Value::Object attributes = {
        {"TRANSLATION", accessor(translations, TINYGLTF_TYPE_VEC3)},
        {"ROTATION", accessor(rotations, TINYGLTF_TYPE_VEC4)},
        {"SCALE", accessor(scales, TINYGLTF_TYPE_VEC3)}};
    node.translation = numbersOf(middle);
    addExtension(model, node, "EXT_mesh_gpu_instancing",
                 {{"attributes", tinygltf::Value(std::move(attributes))}});
    addOnce(model.extensionsRequired, "EXT_mesh_gpu_instancing");
    addNode(model, std::move(node));
}

// world_from_mesh of all instances, by mesh.
std::vector<std::vector<Affine>> flatten(const Scene& scene) {
    std::vector<std::vector<Affine>> result(scene.meshes.size());
    const std::function<void(const Group&, const Affine&)> visit = [&](const Group& group,
                                                                       const Affine& world) {
        for (size_t i = 0; i < group.instances.size(); ++i) {
            const Affine transform = world * group.instances.groupFromChild(i);
            const ChildRef child = group.instances.child(i);
            if (child.isGroup()) {
                visit(scene.groups[child.index()], transform);
            } else {
                result[child.index()].push_back(transform);
            }
        }
    };
    visit(scene.groups.at(scene.root), Affine());
    return result;
}

void addCamera(tinygltf::Model& model, const Camera& source) {
    tinygltf::Camera camera;
    camera.name = source.name;
    if (source.orthographic) {
        camera.type = "orthographic";
        camera.orthographic.xmag = camera.orthographic.ymag = 0.5 * source.height;
        camera.orthographic.znear = source.near_z;
        camera.orthographic.zfar = source.far_z;
    } else {
        camera.type = "perspective";
        camera.perspective.yfov = source.fov_y;
        camera.perspective.znear = source.near_z;
        camera.perspective.zfar = source.far_z;
    }
    model.cameras.push_back(camera);
    tinygltf::Node node;
    node.name = source.name;
    node.camera = int(model.cameras.size()) - 1;
    // glTF's cameras look along -z and have y up.
    const DMat3& m = source.world_from_camera;
    node.translation = numbersOf(source.eye);
    node.rotation = numbersOf(glm::normalize(glm::quat_cast(DMat3(m[0], -m[1], -m[2]))));
    addNode(model, std::move(node));
}

// axis: where it shines.
void addLight(tinygltf::Model& model, tinygltf::Light light, const Vec3& strength,
              const DVec3& position, const DVec3& axis) {
    const float intensity = std::max({strength.x, strength.y, strength.z});
    light.intensity = intensity;
    const Vec3 color = intensity > 0.0f ? strength / intensity : Vec3(1.0f);
    light.color = numbersOf(DVec3(color));
    model.lights.push_back(light);
    tinygltf::Node node;
    node.translation = numbersOf(position);
    node.rotation = numbersOf(glm::rotation(DVec3(0, 0, -1), axis));
    addExtension(model, node, "KHR_lights_punctual",
                 {{"light", tinygltf::Value(int(model.lights.size()) - 1)}});
    addNode(model, std::move(node));
}

void addLights(tinygltf::Model& model, const Lighting& lighting) {
    for (const Sun& sun : lighting.suns) {
        tinygltf::Light light;
        light.type = "directional";
        addLight(model, light, sun.irradiance, DVec3(0.0), -DVec3(sun.direction_to_light));
    }
    for (const PointLight& source : lighting.points) {
        tinygltf::Light light;
        light.type = source.is_spot ? "spot" : "point";
        light.range = source.range;
        light.spot.innerConeAngle = source.inner_cone;
        light.spot.outerConeAngle = source.outer_cone;
        addLight(model, light, source.intensity, source.position,
                 source.is_spot ? DVec3(source.axis) : DVec3(0, 0, -1));
    }
}

tinygltf::Model emptyModel(const std::vector<Material>& materials) {
    tinygltf::Model model;
    model.asset.version = "2.0";
    model.asset.generator = "stipple";
    model.buffers.emplace_back();
    for (const Material& material : materials) addMaterial(model, material);
    model.scenes.emplace_back();
    model.defaultScene = 0;
    return model;
}

void save(const std::string& path, const tinygltf::Model& model) {
    constexpr size_t kMostBytes = 0xff000000u;  // the format counts bytes in 32 bits
    if (model.buffers[0].data.size() > kMostBytes)
        throw Error(ErrorCode::kInvalidArgument, path,
                    "more than 4 GB do not fit into a glTF file");
    std::ostringstream stream;
    if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, false,
                                                     !path.ends_with(".gltf"))) {
        throw Error(ErrorCode::kInternal, path, "could not be encoded as glTF");
    }
    saveFile(path, stream.str());
}

}  // namespace

void saveGlb(const std::string& path, const Mesh& mesh, const std::vector<Material>& materials) {
    if (mesh.triangles.empty())
        throw Error(ErrorCode::kInvalidArgument, path, "the mesh has no triangles");
    constexpr size_t kMostMeshBytes = 0xff000000u;  // before anything is copied
    if (fileBytes(mesh) > kMostMeshBytes)
        throw Error(ErrorCode::kInvalidArgument, path, "the mesh is too large for a .glb");
    std::vector<Material> untextured = materials;
    for (Material& material : untextured) {
        material.base_texture = kNoTexture;
        material.normal_map = {};
    }
    tinygltf::Model model = emptyModel(untextured);
    tinygltf::Node node;
    node.name = mesh.name;
    node.mesh = addMesh(model, mesh);
    addNode(model, std::move(node));
    save(path, model);
}

void saveSceneGltf(const std::string& path, const Scene& scene) {
    const double n = scene.groups.at(scene.root).instances_total;
    if (n > kMostExportedInstances) {
        char message[160];
        std::snprintf(message, sizeof message,
                      "the scene has %.3g instances; glTF has no nested groups, and more than %.0g "
                      "instances are not written",
                      n, kMostExportedInstances);
        throw Error(ErrorCode::kUnsupported, path, message);
    }
    const std::vector<std::vector<Affine>> instances = flatten(scene);
    tinygltf::Model model = emptyModel(scene.materials);
    for (const Texture& texture : scene.textures) addTexture(model, texture);
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        const Mesh& mesh = scene.meshes[i];
        if (instances[i].empty() || mesh.triangles.empty()) continue;
        addInstances(model, addMesh(model, mesh), mesh.name, instances[i]);
    }
    if (model.meshes.empty())
        throw Error(ErrorCode::kInvalidArgument, path, "the scene has no triangles");
    for (const Camera& camera : scene.cameras) {
        if (camera.name != "default") addCamera(model, camera);  // made when the file is read
    }
    addLights(model, scene.lighting);
    save(path, model);
}

}  // namespace stipple
