// SPDX-License-Identifier: Apache-2.0
// Hybrid models beside rays through their sources: near and far, by surfels alone, without holes
// from anywhere, with every reconstruction, instanced and edited.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <render/renderer.h>
#include <sampling/patch_choice.h>
#include <scenegraph/io/hybrid.h>
#include <scenegraph/io/hybrid_file.h>
#include <scenegraph/io/load.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/scene_editor.h>
#include <tests/image/model_views.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

namespace stipple {
namespace {

Scene showing(Scene scene, ChildRef child, ThreadPool& pool) {
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(2.0f)});
    Group group;
    group.instances.add(child, Affine());
    scene.groups.push_back(std::move(group));
    scene.root = uint32_t(scene.groups.size() - 1);
    buildScene(scene, pool);
    return scene;
}

Scene sourceOf(GeneratedMesh made, ThreadPool& pool) {
    Scene scene;
    scene.materials = made.materials;
    scene.textures = made.textures;
    scene.meshes.push_back(std::move(made.mesh));
    return showing(std::move(scene), ChildRef::mesh(0), pool);
}

Scene modelOf(const Scene& source, const HybridOptions& options, ThreadPool& pool) {
    HybridReport report;
    const CancelFlag cancel;
    const std::string text = hybridFileText(buildHybrid(
        source, options, pool, cancel, [](const char*, double) {}, report));
    MemoryBudget budget(0);
    Scene scene;
    const ChildRef child = addHybridModel(scene, parseHybridFile(text, budget, "model"), "model");
    return showing(std::move(scene), child, pool);
}

GeneratedMesh torus() { return makePrimitive("torus", 20000, Vec3(0.8f, 0.5f, 0.3f)); }

TEST(Hybrid, looksLikeRaysAtAnyDistance) {
    ThreadPool pool(2);
    const Scene source = sourceOf(torus(), pool), model = modelOf(source, HybridOptions(), pool);
    for (const double size : {24.0, 48.0, 100.0, 200.0, 1000.0}) {
        const Camera camera = cameraTo(source, maskDirectionOf(17), size, 160);
        const Image rays = draw(source, camera, 160, Method::kRaycast, 16, pool),
                    picture = draw(model, camera, 160, Method::kPoints, 1, pool);
        EXPECT_GE(compareImages(picture, rays, pool).psnr, 28.0) << size;
        EXPECT_LE(compareImages(picture, rays, pool).holes->count, 0u) << size;
    }
}

TEST(Hybrid, isTheMeshWhereItsTrianglesAreSmall) {
    ThreadPool pool(2);
    const Scene model = modelOf(sourceOf(torus(), pool), HybridOptions(), pool);
    const auto has_patches = [](const Mesh& mesh) { return !mesh.patches.empty(); };
    const Mesh& mesh = *std::find_if(model.meshes.begin(), model.meshes.end(), has_patches);
    const auto areDrawn = [&](double size, int subpixels) {
        const View view =
            makeView(cameraTo(model, maskDirectionOf(17), size, 160), 160, 160, subpixels);
        const DMat3& rotation = view.camera_from_world;
        const BoxProjection box =
            projectBox(view, rotation, rotation * -view.eye_world, mesh.nodes[0].bounds);
        return drawsPatches(mesh, box, rotation, view, RenderSettings());
    };
    EXPECT_FALSE(areDrawn(20.0, 4));
    EXPECT_TRUE(areDrawn(40.0, 4));
    EXPECT_TRUE(areDrawn(40.0, 2));  // a pixel of few subpixels: four open ones show
}

TEST(Hybrid, surfelsAloneLeaveNoHolesFromAnywhere) {
    ThreadPool pool(2);
    HybridOptions options;
    options.keep = PatchKind::kSurfels;
    const Scene source = sourceOf(torus(), pool), model = modelOf(source, options, pool);
    size_t holes = 0;
    for (int d = 0; d < kMaskDirections; d += 2) {
        const Camera camera = cameraTo(source, maskDirectionOf(d), 80.0 + 2.0 * d, 200);
        const Image rays = draw(source, camera, 200, Method::kRaycast, 16, pool),
                    picture = draw(model, camera, 200, Method::kPoints, 1, pool, 1);
        holes += compareImages(picture, rays, pool).holes->count;
    }
    EXPECT_LE(holes, 2u);
}

TEST(Hybrid, everyReconstructionShowsIt) {
    ThreadPool pool(2);
    HybridOptions options;
    options.keep = PatchKind::kSurfels;
    const Scene source = sourceOf(torus(), pool), model = modelOf(source, options, pool);
    const Camera camera = cameraTo(source, maskDirectionOf(40), 150.0, 160);
    const Image rays = draw(source, camera, 160, Method::kRaycast, 16, pool);
    for (const Reconstruct method :
         {Reconstruct::kPerPixel, Reconstruct::kSplat, Reconstruct::kGaussian,
          Reconstruct::kPullPush, Reconstruct::kEwa}) {
        const Image picture = draw(model, camera, 160, Method::kPoints, 1, pool, 1, method);
        EXPECT_GE(compareImages(picture, rays, pool).psnr, 24.0) << int(method);
        EXPECT_LE(compareImages(picture, rays, pool).holes->count, 2u) << int(method);
    }
}

// Models of the test data, from 100 directions and at as many sizes.
TEST(Hybrid, realModelsHaveNoHolesAndLookLikeRays) {
    const char* folder = std::getenv("STIPPLE_TEST_DATA");
    if (!folder || !*folder) GTEST_SKIP() << "no test data (STIPPLE_TEST_DATA)";
    ThreadPool pool(2);
    const CancelFlag cancel;
    for (const char* file : {"bunny/bunny.glb", "dragon_medium.glb", "spot/spot.glb"}) {
        const std::filesystem::path path = std::filesystem::path(folder) / "meshes" / file;
        if (!std::filesystem::exists(path)) GTEST_SKIP() << "no test data " << path;
        Diagnostics diagnostics;
        Scene source = loadScene(path.string(), {true, 0, nullptr}, pool, diagnostics);
        Scene model = modelOf(source, HybridOptions(), pool);
        model.lighting = source.lighting;
        size_t holes = 0;
        double worst = 1e9;
        for (int i = 0; i < 100; ++i) {
            const Camera camera =
                cameraTo(source, maskDirectionOf(i * 37 % kMaskDirections), 30.0 + 2.0 * i, 96);
            const Image rays = draw(source, camera, 96, Method::kRaycast, 16, pool),
                        picture = draw(model, camera, 96, Method::kPoints, 1, pool, 4);
            const auto result = compareImages(picture, rays, pool);
            holes += result.holes->count;
            worst = std::min(worst, result.psnr);
        }
        EXPECT_GE(worst, 28.0) << file;
        EXPECT_LE(holes, 0u) << file;
    }
}

TEST(Hybrid, texturesStay) {
    ThreadPool pool(2);
    RockParams params;
    const Scene source = sourceOf(makeRock(params), pool),
                model = modelOf(source, HybridOptions(), pool);
    const Camera camera = cameraTo(source, maskDirectionOf(3), 300.0, 200);
    EXPECT_GE(compareImages(draw(model, camera, 200, Method::kPoints, 1, pool),
                            draw(source, camera, 200, Method::kRaycast, 16, pool), pool)
                  .psnr,
              32.0);
}

TEST(Hybrid, sameBitsForAnyThreadsAndTilesAndOneObject) {
    ThreadPool one(1), three(3);
    const Scene source = sourceOf(torus(), one), model = modelOf(source, HybridOptions(), one);
    const Camera camera = cameraTo(source, maskDirectionOf(9), 120.0, 160);
    EXPECT_EQ(draw(model, camera, 160, Method::kPoints, 1, one).data,
              draw(model, camera, 160, Method::kPoints, 1, three).data);
}

TEST(Hybrid, instancesAreShownAndEdited) {
    ThreadPool pool(2);
    const Scene source = sourceOf(torus(), pool);
    const auto row = [&](Scene scene) {
        Group& group = scene.groups[scene.root];
        const ChildRef child = group.instances.child(0);
        for (int i = 1; i < 5; ++i) {
            Affine at;
            at.translation = DVec3(1.5 * i, 0.0, -1.0 * i);
            group.instances.add(child, at);
        }
        group.nodes.clear();
        buildScene(scene, pool);
        return scene;
    };
    const Scene many = row(source), models = row(modelOf(source, HybridOptions(), pool));
    const Camera camera = cameraTo(many, glm::normalize(Vec3(0.2f, 0.4f, 1.0f)), 300.0, 200);
    const Image rays = draw(many, camera, 200, Method::kRaycast, 16, pool);
    const Image picture = draw(models, camera, 200, Method::kPoints, 1, pool);
    EXPECT_GE(compareImages(picture, rays, pool).psnr, 28.0);
    EXPECT_LE(compareImages(picture, rays, pool).holes->count, 0u);
}

}  // namespace
}  // namespace stipple
