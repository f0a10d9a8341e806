// SPDX-License-Identifier: Apache-2.0
// Small scenes in memory, and pictures of them, for the image tests.
#pragma once

#include <render/renderer.h>
#include <scenegraph/procedural/generators.h>

namespace stipple {

inline constexpr Reconstruct kReconstructions[] = {Reconstruct::kPerPixel, Reconstruct::kSplat,
                                                   Reconstruct::kGaussian, Reconstruct::kPullPush,
                                                   Reconstruct::kEwa,      Reconstruct::kBins};

inline uint32_t addMesh(Scene& scene, GeneratedMesh made) {
    for (uint16_t& m : made.mesh.triangle_material) m = uint16_t(m + scene.materials.size());
    scene.materials.insert(scene.materials.end(), made.materials.begin(), made.materials.end());
    scene.meshes.push_back(std::move(made.mesh));
    return uint32_t(scene.meshes.size() - 1);
}

// turn: about the vertical, radians.
inline Affine placed(const DVec3& at, const DVec3& size = DVec3(1.0), double turn = 0.0) {
    Affine a;
    a.linear =
        DMat3(std::cos(turn), 0, -std::sin(turn), 0, 1, 0, std::sin(turn), 0, std::cos(turn));
    for (int i = 0; i < 3; ++i) a.linear[i] *= size[i];
    a.translation = at;
    return a;
}

// Meshes in one group.
struct TestScene {
    Scene scene;
    Group root;

    TestScene() {
        scene.path = "test";
        root.instances = InstanceStore(DBox3{DVec3(-500), DVec3(500)});
    }
    void add(GeneratedMesh mesh, const Affine& at) {
        root.instances.add(ChildRef::mesh(addMesh(scene, std::move(mesh))), at);
    }
    Scene& build() {
        scene.root = uint32_t(scene.groups.size());
        scene.groups.push_back(root);
        ThreadPool pool(2);
        buildScene(scene, pool);
        return scene;
    }
};

}  // namespace stipple
