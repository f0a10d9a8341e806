// SPDX-License-Identifier: Apache-2.0
// Frames and edits of the same scene, one after the other and from two threads.
#include <render/live_scene.h>

#include <gtest/gtest.h>
#include <render/compare.h>
#include <scenegraph/procedural/generators.h>

#include <atomic>
#include <thread>

namespace stipple {
namespace {

Scene trees(size_t tiles) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    TreeParams params;
    params.triangles = 3000;
    GeneratedMesh tree = makeTree(params);
    scene.materials = tree.materials;
    scene.meshes.push_back(std::move(tree.mesh));
    Group root, tile;
    root.instances = InstanceStore(DBox3{DVec3(-400), DVec3(400)});
    tile.instances = InstanceStore(DBox3{DVec3(-40), DVec3(40)});
    for (int i = 0; i < 25; ++i) {
        tile.instances.add(ChildRef::mesh(0),
                           {DMat3(1.0), DVec3(15.0 * (i % 5) - 30.0, 0, 15.0 * (i / 5) - 30.0)});
    }
    for (size_t i = 0; i < tiles; ++i) {
        root.instances.add(ChildRef::group(1), {DMat3(1.0), DVec3(80.0 * (double(i % 8) - 3.5), 0,
                                                                  -80.0 * double(i / 8))});
    }
    scene.groups = {root, tile};
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

FrameRequest request(Method method) {
    FrameRequest r;
    r.camera = lookAt(DVec3(0, 150, 250), DVec3(0, 0, -150));
    r.settings.width = 120, r.settings.height = 80;
    r.settings.subpixels = 2;
    r.settings.method = method;
    r.settings.samples = method == Method::kRaycast ? 32 : 2;
    return r;
}

double psnrAgainstRays(LiveScene& scene, ThreadPool& pool) {
    return compareImages(scene.render(request(Method::kPoints)).image,
                         scene.render(request(Method::kRaycast)).image, pool)
        .psnr;
}

TEST(LiveScene, theNextFrameShowsAnEditAsWellAsAnyOther) {
    ThreadPool pool(2);
    LiveScene scene(trees(64), pool);
    const double before = psnrAgainstRays(scene, pool);
    const Image first = scene.render(request(Method::kPoints)).image;
    // Half of a tile that is instanced 64 times goes, then comes back.
    std::vector<Affine> places;
    scene.edit([&](SceneEditor& editor) {
        for (uint32_t i = 0; i < 12; ++i) {
            places.push_back(editor.groupFromChild({1, i}));
            editor.remove({1, i});
        }
    });
    EXPECT_GT(psnrAgainstRays(scene, pool), before - 0.5);
    const Image without = scene.render(request(Method::kPoints)).image;
    EXPECT_LT(compareImages(first, without, pool).psnr, 30.0);
    scene.edit([&](SceneEditor& editor) {
        for (uint32_t i = 0; i < 12; ++i) editor.restore({1, i}, ChildRef::mesh(0), places[i]);
    });
    EXPECT_GT(psnrAgainstRays(scene, pool), before - 0.5);
}

TEST(LiveScene, editsFromAnotherThreadTakeTurnsWithFrames) {
    ThreadPool pool(2);
    LiveScene scene(trees(16), pool);
    std::atomic<bool> is_done{false};
    int edits = 0;
    std::thread editor_thread([&] {
        while (!is_done) {
            scene.edit([&](SceneEditor& editor) {
                const InstanceId id =
                    editor.insert(0, ChildRef::mesh(0), {DMat3(1.0), DVec3(edits % 100, 0, 0)});
                if (edits % 2 == 0) editor.remove(id);
            });
            ++edits;
        }
    });
    for (int i = 0; i < 10; ++i) scene.render(request(Method::kPoints));
    is_done = true;
    editor_thread.join();
    EXPECT_GT(edits, 10);
}

}  // namespace
}  // namespace stipple
