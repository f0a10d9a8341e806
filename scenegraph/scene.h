// SPDX-License-Identifier: Apache-2.0
// The scene: assets, groups of instances nested to any depth (a directed acyclic graph, never
// expanded), cameras and lights.
#pragma once

#include <core/camera_path.h>
#include <core/error.h>
#include <core/light.h>
#include <core/material.h>
#include <core/parallel.h>
#include <scenegraph/group.h>
#include <scenegraph/mesh.h>

#include <map>
#include <string>
#include <vector>

namespace stipple {

struct Scene {
    std::string path;  // the file it came from
    std::vector<Texture> textures;
    std::vector<Material> materials;
    std::vector<Mesh> meshes;
    std::vector<Group> groups;
    uint32_t root = 0;  // index into groups
    std::vector<Camera> cameras;
    std::vector<CameraPath> paths;
    std::map<std::string, ChildRef> names;  // what the scene file calls its assets and groups
    Lighting lighting;
    std::map<std::string, std::string>
        render_defaults;  // the scene file's "render": settings by name

    const Camera* findCamera(const std::string& name) const;
    const CameraPath* findPath(const std::string& name) const;
};

// Of an instance's child, which has been built: as in the sums of the groups that instance it.
inline double childArea(const Scene& scene, ChildRef child) {
    return child.isGroup() ? scene.groups[child.index()].as_child.area
                           : scene.meshes[child.index()].area;
}
// Of everything below, in the group's or mesh's space.
inline Box3 nodeBounds(const Group& group, uint32_t node) {
    const Box3& bounds = group.nodes[node].bounds;
    return {bounds.min - group.slack, bounds.max + group.slack};
}
inline Box3 nodeBounds(const Scene& scene, ChildRef child, uint32_t node) {
    return child.isGroup() ? nodeBounds(scene.groups[child.index()], node)
                           : scene.meshes[child.index()].nodes[node].bounds;
}

// Builds every mesh's and group's octree and sums, children before parents. Throws kInvalidScene
// for a group that contains itself (naming the cycle), singular or non-finite transforms, indices
// out of range.
void buildScene(Scene& scene, ThreadPool& pool);

struct SceneSize {
    double instances = 0;         // mesh instances, expanded
    double stored_instances = 0;  // records in groups
    double triangles_unique = 0;
    double triangles_total = 0;  // expanded
    size_t bytes = 0;            // memory of the scene graph: meshes, pictures, groups, octrees
    size_t instance_bytes = 0;   // of that: groups and their octrees
};
SceneSize sceneSize(const Scene& scene);

// How often each mesh is shown, expanded: one number a mesh. O(stored instances).
std::vector<double> meshInstances(const Scene& scene);

// World-space bounds of everything.
DBox3 sceneBounds(const Scene& scene);

// The same without the discs of models of points, which reach beyond what these were made from:
// what default cameras look at. O(stored instances) if there are such models.
DBox3 sourceBounds(const Scene& scene);

// A camera that sees the whole box from the front, above right.
Camera cameraForBounds(const DBox3& bounds);

}  // namespace stipple
