// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/scene.h>

#include <scenegraph/group_build.h>
#include <scenegraph/group_sums.h>

#include <algorithm>

namespace stipple {

namespace {

// Groups in an order in which children come before parents. Throws for a cycle, naming it.
std::vector<uint32_t> childrenFirst(const Scene& scene) {
    enum class State : uint8_t { kNew, kOpen, kDone };
    const size_t n = scene.groups.size();
    // Distinct child groups of each group.
    std::vector<std::vector<uint32_t>> children(n);
    std::vector<size_t> seen_by(n, n);
    for (size_t g = 0; g < n; ++g) {
        const InstanceStore& instances = scene.groups[g].instances;
        for (size_t i = 0; i < instances.size(); ++i) {
            const ChildRef child = instances.child(i);
            if (child.isNone()) continue;
            const size_t limit = child.isGroup() ? n : scene.meshes.size();
            if (child.index() >= limit) {
                throw Error(ErrorCode::kInvalidScene, scene.path,
                            "group \"" + scene.groups[g].name + "\" instances what does not exist");
            }
            if (child.isGroup() && seen_by[child.index()] != g) {
                seen_by[child.index()] = g;
                children[g].push_back(child.index());
            }
        }
    }
    std::vector<State> state(n, State::kNew);
    std::vector<uint32_t> order, path;
    std::vector<size_t> next(n, 0);
    for (uint32_t start = 0; start < n; ++start) {
        if (state[start] != State::kNew) continue;
        path.push_back(start);
        state[start] = State::kOpen;
        while (!path.empty()) {
            const uint32_t g = path.back();
            if (next[g] == children[g].size()) {
                state[g] = State::kDone;
                order.push_back(g);
                path.pop_back();
                continue;
            }
            const uint32_t child = children[g][next[g]++];
            if (state[child] == State::kOpen) {
                std::string cycle;
                for (size_t i = std::find(path.begin(), path.end(), child) - path.begin();
                     i < path.size(); ++i) {
                    cycle += scene.groups[path[i]].name + " > ";
                }
                throw Error(ErrorCode::kInvalidScene, scene.path,
                            "group contains itself: " + cycle + scene.groups[child].name);
            }
            if (state[child] == State::kNew) {
                state[child] = State::kOpen;
                path.push_back(child);
            }
        }
    }
    return order;
}

}  // namespace

void buildScene(Scene& scene, ThreadPool& pool) {
    pool.forEach(scene.meshes.size(), [&](size_t i, int) {
        buildMesh(scene.meshes[i], scene.materials, scene.path + ": " + scene.meshes[i].name);
    });
    for (uint32_t g : childrenFirst(scene)) {
        buildGroup(scene, scene.groups[g], scene.path + ": /groups/" + scene.groups[g].name, pool);
    }
}

const Camera* Scene::findCamera(const std::string& name) const {
    for (const Camera& c : cameras) {
        if (c.name == name) return &c;
    }
    return nullptr;
}

const CameraPath* Scene::findPath(const std::string& name) const {
    for (const CameraPath& p : paths) {
        if (p.name == name) return &p;
    }
    return nullptr;
}

SceneSize sceneSize(const Scene& scene) {
    SceneSize size;
    for (const Mesh& m : scene.meshes) {
        if (!m.is_patch) size.triangles_unique += double(m.triangles.size());
        size.bytes += m.bytes();
    }
    for (const Texture& t : scene.textures) size.bytes += t.bytes();
    if (scene.lighting.sky.environment) size.bytes += scene.lighting.sky.environment->bytes();
    for (const Group& g : scene.groups) {
        size.stored_instances += g.nodes.empty() ? 0.0 : double(g.nodes[0].count);
        size.instance_bytes += g.bytes();
    }
    size.bytes += size.instance_bytes;
    if (scene.root < scene.groups.size()) {
        size.instances = scene.groups[scene.root].instances_total;
        size.triangles_total = scene.groups[scene.root].triangles_total;
    }
    return size;
}

std::vector<double> meshInstances(const Scene& scene) {
    std::vector<double> meshes(scene.meshes.size(), 0.0), groups(scene.groups.size(), 0.0);
    if (scene.root >= scene.groups.size()) return meshes;
    groups[scene.root] = 1.0;
    const std::vector<uint32_t> order = childrenFirst(scene);
    for (auto g = order.rbegin(); g != order.rend(); ++g) {
        const InstanceStore& instances = scene.groups[*g].instances;
        if (groups[*g] == 0.0) continue;
        for (size_t i = 0; i < instances.size(); ++i) {
            const ChildRef child = instances.child(i);
            if (child.isNone()) continue;
            (child.isGroup() ? groups : meshes)[child.index()] += groups[*g];
        }
    }
    return meshes;
}

DBox3 sceneBounds(const Scene& scene) {
    return scene.root < scene.groups.size() ? scene.groups[scene.root].bounds : DBox3();
}

DBox3 sourceBounds(const Scene& scene) {
    const auto has_discs = [](const Mesh& m) { return m.surfels != nullptr; };
    if (scene.root >= scene.groups.size() ||
        std::none_of(scene.meshes.begin(), scene.meshes.end(), has_discs))
        return sceneBounds(scene);
    std::vector<DBox3> bounds(scene.groups.size());
    for (const uint32_t g : childrenFirst(scene)) {
        const InstanceStore& instances = scene.groups[g].instances;
        for (size_t i = 0; i < instances.size(); ++i) {
            const ChildRef child = instances.child(i);
            if (child.isNone()) continue;
            ChildSums sums;
            if (child.isGroup()) {
                sums.bounds = bounds[child.index()];
            } else if (const Box3& b = scene.meshes[child.index()].source_bounds; !b.isEmpty()) {
                sums.bounds = {DVec3(b.min), DVec3(b.max)};
            }
            DVec3 center, half;
            if (instanceBox(sums, instances.groupFromChild(i), center, half))
                bounds[g].extend(DBox3{center - half, center + half});
        }
    }
    return bounds[scene.root];
}

Camera cameraForBounds(const DBox3& bounds) {
    const DBox3 box = bounds.isEmpty() ? DBox3{DVec3(-1), DVec3(1)} : bounds;
    const DVec3 center = box.center();
    const double radius = std::max(0.5 * glm::length(box.extent()), 1e-6);
    Camera defaults;
    const double distance = radius / std::sin(0.5 * defaults.fov_y);
    Camera camera = lookAt(center + distance * glm::normalize(DVec3(0.4, 0.35, 1.0)), center);
    camera.name = "default";
    camera.near_z = distance * 1e-3;
    return camera;
}

}  // namespace stipple
