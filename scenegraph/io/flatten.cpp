// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/flatten.h>

namespace stipple {

namespace {

class Flattener {
public:
    Flattener(const Scene& scene, const CancelFlag& cancel) : scene_(scene), cancel_(cancel) {
        const std::vector<double> shown = meshInstances(scene);
        for (size_t m = 0; m < shown.size(); ++m) {
            const Mesh& mesh = scene.meshes[m];
            if (shown[m] == 0.0 || mesh.triangles.empty()) continue;
            triangles_ += shown[m] * double(mesh.triangles.size());
            has_normals_ = has_normals_ || !mesh.normals.empty();
            has_uvs_ = has_uvs_ || !mesh.uvs.empty();
            has_tangents_ = has_tangents_ || !mesh.tangents.empty();
            has_colors_ = has_colors_ || !mesh.colors.empty();
            mesh_.more_uvs.resize(std::max(mesh_.more_uvs.size(), mesh.more_uvs.size()));
        }
    }

    Mesh run() {
        constexpr double kMostTriangles = double(1 << 26);
        if (triangles_ == 0.0)
            throw Error(ErrorCode::kInvalidScene, scene_.path, "has no triangles");
        if (triangles_ > kMostTriangles)
            throw Error(ErrorCode::kUnsupported, scene_.path, "has more than 2^26 triangles");
        addGroup(scene_.root, Affine(), 0);
        return std::move(mesh_);
    }

private:
    void addGroup(uint32_t group_index, const Affine& world_from_group, int depth) {
        const Group& group = scene_.groups[group_index];
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef child = group.instances.child(i);
            if (child.isNone()) continue;
            const Affine world_from_child = world_from_group * group.instances.groupFromChild(i);
            if (!child.isGroup()) {
                addMesh(scene_.meshes[child.index()], world_from_child);
            } else if (depth < kDeepestNesting) {
                addGroup(child.index(), world_from_child, depth + 1);
            }
        }
    }

    void addMesh(const Mesh& mesh, const Affine& world_from_object) {
        if (cancel_.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
        DMat3 area_map = cofactor(world_from_object.linear);
        const bool is_mirrored = glm::dot(world_from_object.linear[0], area_map[0]) < 0.0;
        if (is_mirrored) area_map *= -1.0;
        const auto addVertex = [&](uint32_t v, const Vec3& normal) {
            mesh_.positions.emplace_back(world_from_object.point(DVec3(mesh.positions[v])));
            if (has_normals_) mesh_.normals.emplace_back(glm::normalize(area_map * DVec3(normal)));
            if (has_uvs_) mesh_.uvs.push_back(mesh.uvs.empty() ? Vec2(0.0f) : mesh.uvs[v]);
            for (size_t l = 0; l < mesh_.more_uvs.size(); ++l) {
                const bool has = l < mesh.more_uvs.size() && !mesh.more_uvs[l].empty();
                mesh_.more_uvs[l].push_back(has ? mesh.more_uvs[l][v] : Vec2(0.0f));
            }
            if (has_tangents_) {
                const Vec4 t = mesh.tangents.empty() ? Vec4(0.0f) : mesh.tangents[v];
                const Vec3 turned(world_from_object.linear * DVec3(Vec3(t)));
                const float length = glm::length(turned);
                mesh_.tangents.push_back(
                    length > 0.0f ? Vec4(turned / length, is_mirrored ? -t.w : t.w) : Vec4(0.0f));
            }
            if (has_colors_)
                mesh_.colors.push_back(mesh.colors.empty() ? Vec4(1.0f) : mesh.colors[v]);
        };
        // A flat mesh among smooth ones gets its normals at vertices of its own.
        const bool is_split = has_normals_ && mesh.normals.empty();
        const uint32_t first = uint32_t(mesh_.positions.size());
        if (!is_split) {
            for (uint32_t v = 0; v < mesh.positions.size(); ++v)
                addVertex(v, mesh.normals.empty() ? Vec3(0.0f) : mesh.normals[v]);
        }
        for (size_t i = 0; i < mesh.triangles.size(); ++i) {
            UVec3 t = mesh.triangles[i];
            if (is_split) {
                const Vec3* p = mesh.positions.data();
                const Vec3 normal(
                    glm::normalize(glm::cross(DVec3(p[t.y] - p[t.x]), DVec3(p[t.z] - p[t.x]))));
                const uint32_t corner = uint32_t(mesh_.positions.size());
                for (int k = 0; k < 3; ++k) addVertex(t[k], normal);
                t = {corner, corner + 1, corner + 2};
            } else {
                t += first;
            }
            if (is_mirrored) std::swap(t.y, t.z);
            mesh_.triangles.push_back(t);
            mesh_.triangle_material.push_back(mesh.triangle_material[i]);
        }
    }

    const Scene& scene_;
    const CancelFlag& cancel_;
    Mesh mesh_;
    double triangles_ = 0.0;
    bool has_normals_ = false, has_uvs_ = false, has_tangents_ = false, has_colors_ = false;
};

}  // namespace

Mesh flattenScene(const Scene& scene, const CancelFlag& cancel) {
    return Flattener(scene, cancel).run();
}

}  // namespace stipple
