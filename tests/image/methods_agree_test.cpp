// SPDX-License-Identifier: Apache-2.0
// Points, z-buffer and rays show the same picture; the same bits for any number of threads and with
// or without caches.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <tests/image/test_scene.h>

#include <array>

namespace stipple {
namespace {

// A floor, a fine sphere and a few hundred trees in a nested group, at `place`.
Scene testScene(const DVec3& place, int floor_triangles = 2) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    TreeParams params;
    params.triangles = 4000;
    const uint32_t tree = addMesh(scene, makeTree(params));
    const uint32_t ball = addMesh(scene, makePrimitive("sphere", 80000, Vec3(0.7f, 0.3f, 0.2f)));
    const uint32_t floor =
        addMesh(scene, makePrimitive("plane", floor_triangles, Vec3(0.4f, 0.4f, 0.35f)));
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

Texture checker(int texels, std::array<uint8_t, 3> a, std::array<uint8_t, 3> b, bool srgb) {
    Texture t;
    t.srgb = srgb;
    t.levels.push_back({texels, texels, {}});
    for (int i = 0; i < texels * texels; ++i) {
        const auto& c = (i / texels * 8 / texels + i % texels * 8 / texels) % 2 ? a : b;
        t.levels[0].rgba.insert(t.levels[0].rgba.end(), {c[0], c[1], c[2], 255});
    }
    buildMipmaps(t);
    return t;
}

// A ball whose colour, metalness, roughness, normals and emission vary: one near, and 27 small
// ones, turned, mirrored and stretched, in a group that is placed often.
Scene texturedScene() {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    scene.textures = {checker(128, {230, 210, 190}, {120, 40, 20}, true),
                      checker(64, {0, 220, 0}, {0, 80, 255}, false),
                      checker(128, {128, 128, 255}, {160, 110, 240}, false),
                      checker(16, {0, 0, 0}, {0, 60, 160}, true)};
    GeneratedMesh ball = makePrimitive("sphere", 6000, Vec3(1.0f));
    for (const Vec3& p : ball.mesh.positions) ball.mesh.uvs.push_back(Vec2(p.x, p.y + 0.5f * p.z));
    Material& m = ball.materials[0];
    m.base_texture = 0;
    m.metallic = 1.0f;
    m.specular = Vec3(0.04f);
    m.emissive = Vec3(2.0f);
    m.metallic_roughness_map.texture = 1;
    m.normal_map.texture = 2;
    m.emissive_map.texture = 3;
    const uint32_t mesh = addMesh(scene, std::move(ball));
    Group many, root;
    many.name = "many", root.name = "root";
    many.instances = InstanceStore(DBox3{DVec3(-4), DVec3(4)});
    for (int i = 0; i < 27; ++i) {
        const double c = std::cos(0.7 * i), s = std::sin(0.7 * i);
        const DMat3 turn(c, 0, -s, 0, 1, 0, s, 0, c);
        const DMat3 scale = i % 3 == 0   ? DMat3(0.6)
                            : i % 3 == 1 ? DMat3(-0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5)
                                         : DMat3(0.3, 0, 0, 0, 0.8, 0, 0, 0, 0.5);
        many.instances.add(ChildRef::mesh(mesh),
                           {turn * scale, 1.7 * DVec3(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)});
    }
    root.instances = InstanceStore(DBox3{DVec3(-60), DVec3(60)});
    for (int i = 0; i < 12; ++i) {
        root.instances.add(ChildRef::group(0),
                           {DMat3(1.0), DVec3(6.0 * (i % 6) - 15.0, 6.0 * (i / 6), -12.0)});
    }
    root.instances.add(ChildRef::mesh(mesh), {DMat3(3.0), DVec3(0, 3, 6)});
    scene.groups.push_back(std::move(many));
    scene.groups.push_back(std::move(root));
    scene.root = 1;
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

TEST(MethodsAgree, texturesOfAllKindsLookTheSame) {
    const Scene scene = texturedScene();
    FrameRequest r = request(DVec3(0));
    r.camera = lookAt(DVec3(0, 6, 26), DVec3(0, 3, 0));
    const Image reference = castRays(scene, r);
    ThreadPool pool(2);
    r.settings.method = Method::kPoints;
    for (const double threshold : {r.settings.area_threshold, 100.0}) {
        r.settings.area_threshold = threshold;  // the higher, the more are points
        const Image picture = render(scene, r);
        EXPECT_GE(compareImages(picture, reference, pool).psnr, 30.0);
        EXPECT_LT(std::abs(tileMeans(picture, reference).mean), 0.01);
    }
    // Pictures of other sizes show finer levels: never coarser ones than the view asks for.
    r.settings.area_threshold = RenderSettings().area_threshold;
    r.settings.width = 120, r.settings.height = 80;
    const Image small = castRays(scene, r);
    r.settings.method = Method::kPoints;
    EXPECT_GE(compareImages(render(scene, r), small, pool).psnr, 30.0);
}

TEST(MethodsAgree, aCheckerboardRunsToTheHorizonWithoutMoire) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    scene.textures = {checker(128, {240, 240, 240}, {20, 20, 20}, true)};
    Group root;
    root.name = "root";
    for (const int triangles : {2, 20000}) {
        GeneratedMesh plane = makePrimitive("plane", triangles, Vec3(1.0f));
        for (const Vec3& p : plane.mesh.positions)
            plane.mesh.uvs.push_back(150.0f * Vec2(p.x, p.z));
        plane.materials[0].base_texture = 0;
        root.instances = InstanceStore(DBox3{DVec3(-1), DVec3(1)});
        scene.materials.clear();
        scene.meshes.clear();
        scene.groups.clear();
        root.instances.add(ChildRef::mesh(addMesh(scene, std::move(plane))),
                           {DMat3(600.0), DVec3(0)});
        scene.groups.push_back(root);
        ThreadPool pool(2);
        buildScene(scene, pool);
        FrameRequest r = request(DVec3(0));
        r.camera = lookAt(DVec3(3, 1.7, 20), DVec3(0, 0.9, 0));
        r.settings.width = 160, r.settings.height = 108;
        r.settings.method = Method::kRaycast;
        r.settings.samples = 256;
        const Image reference = render(scene, r);
        r.settings.method = Method::kPoints;
        r.settings.samples = RenderSettings().samples;
        EXPECT_GE(compareImages(render(scene, r), reference, pool).psnr, 36.0);
        r.settings.subpixels = 1;
        EXPECT_GE(compareImages(render(scene, r), reference, pool).psnr, 30.0);
    }
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

TEST(MethodsAgree, aCacheThatOverflowsChangesNothing) {
    const Scene scene = testScene(DVec3(0));
    FrameRequest r = request(DVec3(0));
    r.settings.cache_mb = 1;
    ThreadPool pool(2);
    Renderer renderer(scene, pool);
    for (const double x : {6.0, -20.0, 6.0, 40.0, 6.0}) {
        r.camera = lookAt(DVec3(x, 9, 22), DVec3(0, 4, -20));
        const Frame frame = renderer.render(r);
        FrameRequest uncached = r;
        uncached.settings.cache_mb = 0;
        EXPECT_EQ(frame.image.data, render(scene, uncached).data) << x;
        // What is visible of the plants is kept beside the lists while a frame lasts.
        EXPECT_LT(frame.stats.cache_bytes, size_t(3) << 20);
    }
}

// Two rocks of triangles about as large as a pixel, so that points and triangles meet on one
// surface, on a plane.
Scene rockScene() {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    RockParams params;
    params.seed = 4;
    params.radius = 1.0;
    params.subdivisions = 7;
    const uint32_t rock = addMesh(scene, makeRock(params));
    const uint32_t floor = addMesh(scene, makePrimitive("plane", 2, Vec3(0.45f, 0.45f, 0.42f)));
    Group root;
    root.name = "root";
    root.instances = InstanceStore(DBox3{DVec3(-400), DVec3(400)});
    const DMat3 turned(-0.77, 0, -0.64, 0, 1, 0, 0.64, 0, -0.77);
    root.instances.add(ChildRef::mesh(rock), {DMat3(1.0), DVec3(0, 0.7, 0)});
    root.instances.add(ChildRef::mesh(rock), {turned * 0.6, DVec3(-1.9, 0.3, -1.6)});
    root.instances.add(ChildRef::mesh(floor), {DMat3(400.0), DVec3(0)});
    scene.groups.push_back(std::move(root));
    scene.root = 0;
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

void expectCullingChangesNothing(const Scene& scene, FrameRequest r) {
    for (const Reconstruct reconstruct : kReconstructions) {
        r.settings.reconstruct = reconstruct;
        r.settings.splat_size = 2.0;
        r.settings.culling = true;
        const Image culled = render(scene, r);
        r.settings.culling = false;
        EXPECT_TRUE(culled.data == render(scene, r).data)
            << settingValue(r.settings, "reconstruct") << " subpixels " << r.settings.subpixels;
    }
}

TEST(MethodsAgree, cullingChangesNothing) {
    for (const int floor_triangles : {2, 20000})
        expectCullingChangesNothing(testScene(DVec3(0), floor_triangles), request(DVec3(0)));
}

TEST(MethodsAgree, cullingChangesNothingWhereSurfacesAreClosed) {
    const Scene scene = rockScene();
    FrameRequest r = request(DVec3(0));
    r.settings.width = 160;
    r.settings.height = 120;
    r.settings.seed = 7;
    for (const double angle : {0.0, 0.7}) {
        const DVec3 eye(1.7 * std::sin(angle), 1.35, 1.7 * std::cos(angle));
        r.camera = lookAt(eye, DVec3(0, 0.7, 0));
        r.camera.fov_y = 0.73;
        for (const int subpixels : {1, 2}) {
            r.settings.subpixels = subpixels;
            expectCullingChangesNothing(scene, r);
        }
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
