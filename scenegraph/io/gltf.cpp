// SPDX-License-Identifier: Apache-2.0
// From the nodes of a glTF file to instances. Meshes, materials and pictures are in gltf_mesh.cpp
// and gltf_material.cpp.
#include <scenegraph/io/gltf.h>

#include <scenegraph/io/gltf_lights.h>
#include <scenegraph/io/gltf_mesh.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/transform.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <tuple>

namespace stipple {

namespace {

struct Placement {
    ChildRef child;
    Affine group_from_child;
};

constexpr size_t kMaxRepeatedNodes = 1000000;

// Walks the default scene, without recursion: a file may nest a million nodes.
class NodeWalk {
public:
    NodeWalk(const GltfDocument& document, Scene& scene)
        : document_(document), scene_(scene), materials_(document, scene) {
        for (const Camera& camera : scene.cameras) camera_names_.insert(camera.name);
    }

    std::vector<Placement> run();

private:
    std::vector<std::pair<int, std::string>> roots() const;
    void visit(int node, const Affine& world_from_node);
    void placeMesh(const tinygltf::Node& node, const Affine& world_from_node,
                   const std::string& path);
    void placeSkinned(int node);
    // The mesh in that pose as a child to instance, none if it shows nothing. Made once for each
    // mesh, morph weights and skin (-1: none).
    std::optional<ChildRef> meshFor(const tinygltf::Node& node, int skin, const std::string& path);
    std::vector<Affine> jointTransforms(int skin, const std::string& path) const;
    void place(ChildRef mesh, const Affine& world_from_mesh, const std::string& path);
    std::vector<Affine> gpuInstances(const tinygltf::Value& extension, const std::string& path);
    void addCamera(const tinygltf::Node& node, const Affine& world_from_node,
                   const std::string& path);

    const GltfDocument& document_;
    Scene& scene_;
    GltfMaterials materials_;
    std::map<std::tuple<int, std::vector<double>, int>, std::optional<ChildRef>> meshes_;
    std::vector<int> skinned_;  // nodes, which wait until the places of all joints are known
    std::map<int, Affine> world_from_node_;  // of all nodes, if there are skins
    std::vector<Placement> placements_;
    std::set<std::string> camera_names_;
    std::map<std::string, int> camera_numbers_;  // given to cameras of the same name
};

Affine nodeTransform(const GltfDocument& document, const tinygltf::Node& node,
                     const std::string& path) {
    if (!node.matrix.empty()) {
        Affine result;
        if (!affineFromMatrix(node.matrix.data(), result)) {
            document.fail(ErrorCode::kInvalidScene, path + ".matrix",
                          "the last row is not 0 0 0 1");
        }
        return result;
    }
    const DVec3 t = node.translation.empty()
                        ? DVec3(0)
                        : DVec3(node.translation[0], node.translation[1], node.translation[2]);
    const DVec3 s =
        node.scale.empty() ? DVec3(1) : DVec3(node.scale[0], node.scale[1], node.scale[2]);
    DMat3 r(1.0);
    if (!node.rotation.empty() && !rotationFromQuaternion(node.rotation.data(), r)) {
        document.fail(ErrorCode::kInvalidScene, path + ".rotation", "the quaternion is zero");
    }
    return affineFromParts(t, r, s);
}

std::vector<std::pair<int, std::string>> NodeWalk::roots() const {
    const tinygltf::Model& model = document_.model;
    std::vector<std::pair<int, std::string>> roots;
    if (model.defaultScene >= 0)
        document_.checkIndex(model.defaultScene, model.scenes.size(), "scene", "scenes");
    if (!model.scenes.empty()) {
        const size_t s = size_t(std::max(0, model.defaultScene));
        for (size_t i = 0; i < model.scenes[s].nodes.size(); ++i) {
            roots.emplace_back(model.scenes[s].nodes[i], "scenes[" + std::to_string(s) +
                                                             "].nodes[" + std::to_string(i) + "]");
        }
        return roots;
    }
    std::vector<bool> is_child(model.nodes.size(), false);
    for (const tinygltf::Node& node : model.nodes) {
        for (int child : node.children) {
            if (size_t(child) < is_child.size()) is_child[child] = true;
        }
    }
    for (size_t i = 0; i < model.nodes.size(); ++i) {
        if (!is_child[i]) roots.emplace_back(int(i), "nodes[" + std::to_string(i) + "]");
    }
    return roots;
}

std::vector<Placement> NodeWalk::run() {
    struct Step {
        int node;
        Affine world_from_parent;
        bool leaves;  // the node's children are done
    };
    std::vector<Step> steps;
    std::vector<bool> is_open(document_.model.nodes.size(), false);
    const auto push = [&](int node, const Affine& world_from_parent, const std::string& path) {
        document_.checkIndex(node, is_open.size(), path, "nodes");
        if (is_open[node])
            document_.fail(ErrorCode::kInvalidScene, path,
                           "node " + std::to_string(node) + " contains itself");
        steps.push_back({node, world_from_parent, false});
    };
    auto root_nodes = roots();
    std::reverse(root_nodes.begin(), root_nodes.end());
    for (const auto& [node, path] : root_nodes) push(node, Affine(), path);
    for (size_t n_visits = 0; !steps.empty();) {
        const Step step = steps.back();
        steps.pop_back();
        is_open[step.node] = !step.leaves;
        if (step.leaves) continue;
        const tinygltf::Node& node = document_.model.nodes[step.node];
        const std::string path = "nodes[" + std::to_string(step.node) + "]";
        // glTF forbids nodes of several parents, files have them all the same; a few can stand for
        // any number of nodes.
        if (++n_visits > is_open.size() + kMaxRepeatedNodes) {
            document_.fail(ErrorCode::kUnsupported, path,
                           "nodes of several parents make more than 10^6 nodes");
        }
        if (n_visits % 4096 == 0) document_.context.throwIfCancelled();
        const Affine world_from_node =
            step.world_from_parent * nodeTransform(document_, node, path);
        if (!isFinite(world_from_node))
            document_.fail(ErrorCode::kInvalidScene, path, "its transform is not finite");
        visit(step.node, world_from_node);
        steps.push_back({step.node, Affine(), true});
        for (size_t i = node.children.size(); i-- > 0;) {
            push(node.children[i], world_from_node, path + ".children[" + std::to_string(i) + "]");
        }
    }
    for (const int node : skinned_) placeSkinned(node);
    return std::move(placements_);
}

void NodeWalk::visit(int index, const Affine& world_from_node) {
    const tinygltf::Node& node = document_.model.nodes[index];
    const std::string path = "nodes[" + std::to_string(index) + "]";
    if (!document_.model.skins.empty()) world_from_node_.emplace(index, world_from_node);
    if (node.mesh >= 0 && node.skin >= 0) {
        skinned_.push_back(index);
    } else if (node.mesh >= 0) {
        placeMesh(node, world_from_node, path);
    }
    if (node.camera >= 0) addCamera(node, world_from_node, path);
    if (const auto it = node.extensions.find("KHR_lights_punctual"); it != node.extensions.end()) {
        addGltfLight(document_, it->second, world_from_node,
                     path + ".extensions.KHR_lights_punctual", scene_.lighting);
    }
}

std::optional<ChildRef> NodeWalk::meshFor(const tinygltf::Node& node, int skin,
                                          const std::string& path) {
    document_.checkIndex(node.mesh, document_.model.meshes.size(), path + ".mesh", "meshes");
    GltfPose pose;
    pose.morph_weights =
        node.weights.empty() ? document_.model.meshes[node.mesh].weights : node.weights;
    while (!pose.morph_weights.empty() && pose.morph_weights.back() == 0.0)
        pose.morph_weights.pop_back();
    const auto key = std::make_tuple(node.mesh, pose.morph_weights, skin);
    if (const auto it = meshes_.find(key); it != meshes_.end()) return it->second;
    if (skin >= 0) pose.world_from_bind = jointTransforms(skin, path);
    Mesh mesh = loadGltfMesh(document_, node.mesh, pose, materials_);
    std::optional<ChildRef> child;
    if (!mesh.triangles.empty()) {
        scene_.meshes.push_back(std::move(mesh));
        child = ChildRef::mesh(uint32_t(scene_.meshes.size()) - 1);
    }
    return meshes_.emplace(key, child).first->second;
}

std::vector<Affine> NodeWalk::jointTransforms(int index, const std::string& path) const {
    document_.checkIndex(index, document_.model.skins.size(), path + ".skin", "skins");
    const tinygltf::Skin& skin = document_.model.skins[index];
    const std::string skin_path = "skins[" + std::to_string(index) + "]";
    std::vector<Affine> result(skin.joints.size());
    std::vector<float> matrices;
    if (skin.inverseBindMatrices >= 0) {
        const std::string place = skin_path + ".inverseBindMatrices";
        const size_t count =
            accessorCount(document_, skin.inverseBindMatrices, {TINYGLTF_TYPE_MAT4}, place);
        if (count < result.size()) {
            document_.fail(ErrorCode::kInvalidScene, place,
                           "count " + std::to_string(count) + " < the " +
                               std::to_string(result.size()) + " joints");
        }
        matrices = readFloats(document_, skin.inverseBindMatrices, 16, 0.0f, place);
    }
    for (size_t j = 0; j < result.size(); ++j) {
        const std::string place = skin_path + ".joints[" + std::to_string(j) + "]";
        document_.checkIndex(skin.joints[j], document_.model.nodes.size(), place, "nodes");
        Affine joint_from_bind;
        if (!matrices.empty()) {
            const std::vector<double> m(matrices.begin() + std::ptrdiff_t(j * 16),
                                        matrices.begin() + std::ptrdiff_t(j * 16 + 16));
            if (!affineFromMatrix(m.data(), joint_from_bind))
                document_.fail(ErrorCode::kInvalidScene, place,
                               "the last row of its inverse bind matrix is not 0 0 0 1");
        }
        const auto it = world_from_node_.find(skin.joints[j]);
        if (it == world_from_node_.end())
            document_.fail(ErrorCode::kInvalidScene, place, "is not in the scene that is shown");
        result[j] = it->second * joint_from_bind;
    }
    return result;
}

// The transform of a skinned mesh's own node has no meaning: its joints say where it is.
void NodeWalk::placeSkinned(int index) {
    const tinygltf::Node& node = document_.model.nodes[index];
    const std::string path = "nodes[" + std::to_string(index) + "]";
    if (const auto child = meshFor(node, node.skin, path)) place(*child, Affine(), path);
}

void NodeWalk::placeMesh(const tinygltf::Node& node, const Affine& world_from_node,
                         const std::string& path) {
    const std::optional<ChildRef> child = meshFor(node, -1, path);
    if (!child) return;
    const auto instancing = node.extensions.find("EXT_mesh_gpu_instancing");
    if (instancing == node.extensions.end()) return place(*child, world_from_node, path);
    const std::string place_path = path + ".extensions.EXT_mesh_gpu_instancing";
    for (const Affine& node_from_instance : gpuInstances(instancing->second, place_path)) {
        place(*child, world_from_node * node_from_instance, place_path);
    }
}

void NodeWalk::place(ChildRef mesh, const Affine& world_from_mesh, const std::string& path) {
    if (!isFinite(world_from_mesh))
        document_.fail(ErrorCode::kInvalidScene, path, "a transform is not finite");
    if (isSingular(world_from_mesh.linear)) {  // the customary way to hide something
        document_.context.warnOnce(document_.name, "what is scaled to nothing is left out");
        return;
    }
    placements_.push_back({mesh, world_from_mesh});
}

std::vector<Affine> NodeWalk::gpuInstances(const tinygltf::Value& extension,
                                           const std::string& path) {
    const tinygltf::Value& attributes = extension.Get("attributes");
    std::map<std::string, std::vector<float>> values;
    size_t n = 0;
    bool first = true;
    constexpr std::array<std::tuple<const char*, int, int>, 3> kAttributes = {
        {{"TRANSLATION", TINYGLTF_TYPE_VEC3, 3},
         {"ROTATION", TINYGLTF_TYPE_VEC4, 4},
         {"SCALE", TINYGLTF_TYPE_VEC3, 3}}};
    for (const auto& [name, type, components] : kAttributes) {
        if (!attributes.IsObject() || !attributes.Has(name)) continue;
        const std::string place = path + ".attributes." + name;
        const int accessor = attributes.Get(name).GetNumberAsInt();
        const size_t count = accessorCount(document_, accessor, {type}, place);
        if (!first && count != n) {
            document_.fail(
                ErrorCode::kInvalidScene, place,
                "count " + std::to_string(count) + ", but others have " + std::to_string(n));
        }
        n = count, first = false;
        values[name] = readFloats(document_, accessor, components, 0.0f, place);
    }
    // The list of transforms, the list of placements, and what stays in the group.
    document_.context.budget.take(double(n) * (2 * sizeof(Affine) + kBytesPerInstance),
                                  document_.where(path), std::to_string(n) + " instances");
    std::vector<Affine> instances;
    instances.reserve(n);
    const auto vector = [&](const char* name, size_t i, DVec3 fallback) {
        const auto it = values.find(name);
        return it == values.end()
                   ? fallback
                   : DVec3(it->second[i * 3], it->second[i * 3 + 1], it->second[i * 3 + 2]);
    };
    for (size_t i = 0; i < n; ++i) {
        if (i % 65536 == 0) document_.context.throwIfCancelled();
        DMat3 r(1.0);
        if (const auto it = values.find("ROTATION"); it != values.end()) {
            const double q[4] = {it->second[i * 4], it->second[i * 4 + 1], it->second[i * 4 + 2],
                                 it->second[i * 4 + 3]};
            if (!rotationFromQuaternion(q, r)) {
                document_.fail(ErrorCode::kInvalidScene, path,
                               "the quaternion of instance " + std::to_string(i) + " is zero");
            }
        }
        instances.push_back(
            affineFromParts(vector("TRANSLATION", i, DVec3(0)), r, vector("SCALE", i, DVec3(1))));
    }
    return instances;
}

void NodeWalk::addCamera(const tinygltf::Node& node, const Affine& world_from_node,
                         const std::string& path) {
    document_.checkIndex(node.camera, document_.model.cameras.size(), path + ".camera", "cameras");
    const tinygltf::Camera& source = document_.model.cameras[node.camera];
    const DVec3 forward = -world_from_node.linear[2], up = world_from_node.linear[1];
    if (isSingular(world_from_node.linear)) {
        document_.fail(ErrorCode::kInvalidScene, path, "the transform of a camera is singular");
    }
    Camera camera = lookAt(world_from_node.translation,
                           world_from_node.translation + glm::normalize(forward), up);
    camera.orthographic = source.type == "orthographic";
    if (camera.orthographic) {
        camera.height = 2.0 * source.orthographic.ymag;
        camera.near_z = source.orthographic.znear;
        camera.far_z = source.orthographic.zfar;
    } else {
        camera.fov_y = source.perspective.yfov;
        camera.near_z = source.perspective.znear;
        if (source.perspective.zfar > 0.0) camera.far_z = source.perspective.zfar;
    }
    if (!(camera.far_z > camera.near_z)) {
        document_.fail(ErrorCode::kInvalidScene, "cameras[" + std::to_string(node.camera) + "]",
                       "zfar <= znear");
    }
    const std::string name = !source.name.empty() ? source.name
                             : !node.name.empty() ? node.name
                                                  : "camera";
    camera.name = name;
    while (!camera_names_.insert(camera.name).second)
        camera.name = name + " " + std::to_string(++camera_numbers_[name] + 1);
    scene_.cameras.push_back(camera);
}

}  // namespace

ChildRef loadGltf(const std::filesystem::path& path, const std::string& name, Scene& scene,
                  LoadContext& context) {
    context.throwIfCancelled();
    const GltfDocument document = openGltf(path, name, context);
    const std::vector<Placement> placements = NodeWalk(document, scene).run();
    if (placements.empty()) return addEmptyGroup(scene, document.name);

    const Affine& first = placements[0].group_from_child;
    if (placements.size() == 1 && first.linear == DMat3(1.0) && first.translation == DVec3(0.0))
        return placements[0].child;
    DBox3 domain;
    for (const Placement& p : placements) domain.extend(p.group_from_child.translation);
    Group group;
    group.name = document.name;
    group.instances = InstanceStore(domain);
    group.instances.reserve(placements.size());
    for (const Placement& p : placements) group.instances.add(p.child, p.group_from_child);
    scene.groups.push_back(std::move(group));
    return ChildRef::group(uint32_t(scene.groups.size() - 1));
}

ChildRef loadGltf(const std::string& path, Scene& scene, const LoadOptions& options,
                  Diagnostics& diagnostics) {
    LoadContext context(options, diagnostics, folderOf(path));
    return loadGltf(std::filesystem::path(path), path, scene, context);
}

}  // namespace stipple
