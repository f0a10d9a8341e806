// SPDX-License-Identifier: Apache-2.0
// Points, z-buffer and rays show the same picture; the same bits for any number of threads and with
// or without caches.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <render/renderer.h>
#include <scenegraph/procedural/generators.h>

namespace stipple {
namespace {

constexpr Reconstruct kReconstructions[] = {Reconstruct::kPerPixel, Reconstruct::kSplat,
                                            Reconstruct::kGaussian, Reconstruct::kPullPush,
                                            Reconstruct::kEwa};

uint32_t addMesh(Scene& scene, GeneratedMesh made) {
    for (uint16_t& m : made.mesh.triangle_material) m = uint16_t(m + scene.materials.size());
    scene.materials.insert(scene.materials.end(), made.materials.begin(), made.materials.end());
    scene.meshes.push_back(std::move(made.mesh));
    return uint32_t(scene.meshes.size() - 1);
}

// A floor, a fine sphere and a few hundred trees in a nested group, at `place`.
Scene testScene(const DVec3& place) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    TreeParams params;
    params.triangles = 4000;
    const uint32_t tree = addMesh(scene, makeTree(params));
    const uint32_t ball = addMesh(scene, makePrimitive("sphere", 80000, Vec3(0.7f, 0.3f, 0.2f)));
    const uint32_t floor = addMesh(scene, makePrimitive("plane", 2, Vec3(0.4f, 0.4f, 0.35f)));
    Group wood, root;
    wood.name = "wood", root.name = "root";
    wood.instances = InstanceStore(DBox3{DVec3(-200), DVec3(200)});
    for (int i = 0; i < 400; ++i) {
        Affine a;
        const double angle = 2.4 * i;
        a.linear = DMat3(std::cos(angle), 0, -std::sin(angle), 0, 1, 0, std::sin(angle), 0,
                         std::cos(angle));
        a.translation = DVec3(9.0 * (i % 20) - 90.0, 0.0, -9.0 * (i / 20) - 20.0);
        wood.instances.add(ChildRef::mesh(tree), a);
    }
    root.instances = InstanceStore(DBox3{place - 1.0, place + 1.0});
    Affine at;
    at.translation = place;
    root.instances.add(ChildRef::group(0), at);
    at.linear = DMat3(6.0);
    at.translation = place + DVec3(0, 3, 0);
    root.instances.add(ChildRef::mesh(ball), at);
    at.linear = DMat3(600.0);
    at.translation = place;
    root.instances.add(ChildRef::mesh(floor), at);
    scene.groups.push_back(std::move(wood));
    scene.groups.push_back(std::move(root));
    scene.root = 1;
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

FrameRequest request(const DVec3& place) {
    FrameRequest r;
    r.camera = lookAt(place + DVec3(6, 9, 22), place + DVec3(0, 4, -20));
    r.settings.width = 240;
    r.settings.height = 160;
    r.aovs = {"depth", "coverage"};
    return r;
}

Image render(const Scene& scene, FrameRequest r, int threads = 2) {
    ThreadPool pool(threads);
    return Renderer(scene, pool).render(r).image;
}

Image castRays(const Scene& scene, FrameRequest r) {
    r.settings.method = Method::kRaycast;
    r.settings.samples = 64;
    return render(scene, r);
}

TEST(MethodsAgree, pointsAndZBufferShowWhatRaysSee) {
    const Scene scene = testScene(DVec3(0));
    FrameRequest r = request(DVec3(0));
    const Image reference = castRays(scene, r);
    ThreadPool pool(2);
    r.settings.method = Method::kZBuffer;
    r.settings.samples = 1;
    EXPECT_GE(compareImages(render(scene, r), reference, pool).psnr, 32.0);
    r.settings.method = Method::kPoints;
    for (const Reconstruct reconstruct : kReconstructions) {
        r.settings.reconstruct = reconstruct;
        const CompareResult result = compareImages(render(scene, r), reference, pool);
        // Splats of a pixel close the gaps between leaves.
        EXPECT_GE(result.psnr, reconstruct == Reconstruct::kSplat ? 26.0 : 32.0)
            << settingValue(r.settings, "reconstruct");
        ASSERT_TRUE(result.holes);
        EXPECT_LT(result.holes->fraction, 1e-3);
    }
}

TEST(MethodsAgree, allAsPointsIsAsGood) {
    const Scene scene = testScene(DVec3(0));
    FrameRequest r = request(DVec3(0));
    const Image reference = castRays(scene, r);
    r.settings.method = Method::kPoints;
    r.settings.samples = 3;
    r.settings.area_threshold = 40.0;  // leaves near the eye, too
    ThreadPool pool(2);
    const Image picture = render(scene, r);
    EXPECT_GE(compareImages(picture, reference, pool).psnr, 29.0);
    EXPECT_LT(std::abs(tileMeans(picture, reference).mean), 0.02);
}

TEST(MethodsAgree, sameBitsForAnyThreadsAndCaches) {
    const Scene scene = testScene(DVec3(0));
    FrameRequest r = request(DVec3(0));
    for (const Reconstruct reconstruct : kReconstructions) {
        r.settings.reconstruct = reconstruct;
        r.settings.splat_size = 0.5;
        r.settings.cache_mb = 256;
        const Image one = render(scene, r, 1);
        EXPECT_EQ(one.data, render(scene, r, 2).data);
        EXPECT_EQ(one.data, render(scene, r, 7).data);
        r.settings.cache_mb = 0;
        EXPECT_EQ(one.data, render(scene, r, 2).data);
    }
}

TEST(MethodsAgree, cullingChangesNothing) {
    const Scene scene = testScene(DVec3(0));
    FrameRequest r = request(DVec3(0));
    for (const Reconstruct reconstruct : kReconstructions) {
        r.settings.reconstruct = reconstruct;
        r.settings.splat_size = 2.0;
        r.settings.culling = true;
        const Image culled = render(scene, r);
        r.settings.culling = false;
        EXPECT_EQ(culled.data, render(scene, r).data) << settingValue(r.settings, "reconstruct");
    }
}

TEST(MethodsAgree, farFromTheOriginIsTheSame) {
    const DVec3 far(200000.0, 0.0, -150000.0);
    const Image near_picture = render(testScene(DVec3(0)), request(DVec3(0)));
    const Image far_picture = render(testScene(far), request(far));
    ThreadPool pool(2);
    EXPECT_GE(compareImages(far_picture, near_picture, pool).psnr, 45.0);
}

}  // namespace
}  // namespace stipple
