// SPDX-License-Identifier: Apache-2.0
// Morph targets and skins, as the file's default state has them.
#include <scenegraph/io/gltf_primitive.h>

#include <algorithm>

namespace stipple {

namespace {

// The attributes of vertices that follow a joint or several.
struct SkinBinding {
    std::vector<Vec4> joints, weights;  // four a vertex
};

template <class V>
void addScaled(std::vector<V>& to, const std::vector<Vec3>& from, double weight) {
    for (size_t i = 0; i < to.size(); ++i) {
        for (int c = 0; c < 3; ++c)
            to[i][c] = float(double(to[i][c]) + weight * double(from[i][c]));
    }
}

void applyMorphTargets(const GltfDocument& document, const tinygltf::Primitive& source,
                       const std::vector<double>& weights, const std::string& path,
                       GltfPrimitive& p) {
    for (size_t k = 0; k < std::min(weights.size(), source.targets.size()); ++k) {
        if (weights[k] == 0.0) continue;
        document.context.throwIfCancelled();
        const std::string target_path = path + ".targets[" + std::to_string(k) + "].";
        const auto add = [&](const char* name, auto& values) {
            const auto it = source.targets[k].find(name);
            if (it == source.targets[k].end() || values.empty()) return;
            const std::string place = target_path + name;
            addScaled(values,
                      readVectors<Vec3>(document, it->second, {TINYGLTF_TYPE_VEC3}, 0.0f,
                                        p.positions.size(), place),
                      weights[k]);
        };
        add("POSITION", p.positions);
        add("NORMAL", p.normals);
        add("TANGENT", p.tangents);
    }
}

std::vector<SkinBinding> readBindings(const GltfDocument& document,
                                      const tinygltf::Primitive& source, size_t n_vertices,
                                      size_t n_joints, const std::string& path) {
    std::vector<SkinBinding> bindings;
    for (int set = 0;; ++set) {
        const std::string joints_name = "JOINTS_" + std::to_string(set),
                          weights_name = "WEIGHTS_" + std::to_string(set);
        const auto joints = source.attributes.find(joints_name),
                   weights = source.attributes.find(weights_name);
        if (joints == source.attributes.end() || weights == source.attributes.end()) break;
        SkinBinding& b = bindings.emplace_back();
        const std::string place = path + ".attributes." + joints_name;
        document.context.budget.require(32.0 * double(n_vertices), document.where(place),
                                        "joints and weights");
        b.joints = readVectors<Vec4>(document, joints->second, {TINYGLTF_TYPE_VEC4}, 0.0f,
                                     n_vertices, place);
        b.weights = readVectors<Vec4>(document, weights->second, {TINYGLTF_TYPE_VEC4}, 0.0f,
                                      n_vertices, path + ".attributes." + weights_name);
        for (size_t v = 0; v < n_vertices; ++v) {
            for (int c = 0; c < 4; ++c) {
                const float joint = b.joints[v][c];
                if (b.weights[v][c] != 0.0f && !(joint >= 0.0f && joint < float(n_joints))) {
                    document.fail(ErrorCode::kInvalidScene, place,
                                  "joint " + std::to_string(int64_t(joint)) +
                                      ", but the skin has " + std::to_string(n_joints));
                }
            }
        }
    }
    return bindings;
}

void applySkin(const GltfDocument& document, const tinygltf::Primitive& source,
               const std::vector<Affine>& world_from_bind, const std::string& path,
               GltfPrimitive& p) {
    const size_t n = p.positions.size();
    const std::vector<SkinBinding> bindings =
        readBindings(document, source, n, world_from_bind.size(), path);
    if (bindings.empty()) {
        document.context.warnOnce(document.name, path + " has a skin, but no joints and weights");
        return;
    }
    for (size_t v = 0; v < n; ++v) {
        Affine blended{DMat3(0.0), DVec3(0.0)};
        double total = 0.0;
        for (const SkinBinding& b : bindings) {
            for (int c = 0; c < 4; ++c) {
                const double weight = b.weights[v][c];
                if (weight == 0.0) continue;
                const Affine& joint = world_from_bind[size_t(b.joints[v][c])];
                blended.linear += joint.linear * weight;
                blended.translation += joint.translation * weight;
                total += weight;
            }
        }
        // The weights need not add up to one: quantized ones hardly ever do.
        if (total == 0.0) continue;
        blended.linear /= total, blended.translation /= total;
        p.positions[v] = Vec3(blended.point(DVec3(p.positions[v])));
        if (!p.normals.empty()) {
            const double side = glm::determinant(blended.linear) < 0.0 ? -1.0 : 1.0;
            p.normals[v] = Vec3(cofactor(blended.linear) * DVec3(p.normals[v]) * side);
        }
        if (!p.tangents.empty())
            p.tangents[v] =
                Vec4(Vec3(blended.linear * DVec3(Vec3(p.tangents[v]))), p.tangents[v].w);
    }
}

}  // namespace

void applyPose(const GltfDocument& document, const tinygltf::Primitive& source,
               const GltfPose& pose, const std::string& path, GltfPrimitive& primitive) {
    applyMorphTargets(document, source, pose.morph_weights, path, primitive);
    if (!pose.world_from_bind.empty())
        applySkin(document, source, pose.world_from_bind, path, primitive);
    checkPositions(document, primitive.positions, path + ".attributes.POSITION");
}

}  // namespace stipple
