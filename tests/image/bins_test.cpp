// SPDX-License-Identifier: Apache-2.0
// Panes of glass, a ball of mist and canopies of leaves against many rays that pass each layer by
// chance.
#include "test_scene.h"

#include <gtest/gtest.h>
#include <render/compare.h>

namespace stipple {
namespace {

// Four panes behind each other, one of them in fine triangles, a glass ball, a tree and mist before
// a floor and boxes.
Scene glassScene() {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(2.0f)});
    const Vec3 colors[] = {
        {0.8f, 0.1f, 0.1f}, {0.7f, 0.6f, 0.1f}, {0.1f, 0.6f, 0.2f}, {0.1f, 0.2f, 0.8f}};
    Group root;
    root.name = "root";
    root.instances = InstanceStore(DBox3{DVec3(-20), DVec3(20)});
    const DMat3 upright(1, 0, 0, 0, 0, 1, 0, -1, 0);
    for (int i = 0; i < 4; ++i) {
        const uint32_t pane = addMesh(
            scene, makePrimitive("plane", i == 2 ? 200000 : 2, colors[i], 0.3f + 0.1f * float(i)));
        root.instances.add(
            ChildRef::mesh(pane),
            {upright * DMat3(2.4), DVec3(-2.0 + 0.7 * i, 1.4 + 0.2 * (i % 2), 2.0 - i)});
    }
    const uint32_t ball =
        addMesh(scene, makePrimitive("sphere", 30000, Vec3(0.6f, 0.8f, 0.8f), 0.3f));
    root.instances.add(ChildRef::mesh(ball), {DMat3(2.0), DVec3(2.6, 1.2, 1.0)});
    MistParams mist;
    mist.radius = 3.0;
    mist.patches = 60000;
    mist.patch = 0.05;
    mist.depth = 1.0;
    root.instances.add(ChildRef::mesh(addMesh(scene, makeMist(mist))),
                       {DMat3(1.0), DVec3(1, 1.5, -5)});
    TreeParams tree;
    tree.triangles = 8000;
    root.instances.add(ChildRef::mesh(addMesh(scene, makeTree(tree))),
                       {DMat3(0.5), DVec3(-3, 0, -8)});
    const uint32_t box = addMesh(scene, makePrimitive("box", 12, Vec3(0.8f)));
    for (int i = 0; i < 6; ++i)
        root.instances.add(ChildRef::mesh(box), {DMat3(0.6), DVec3(1.2 * i - 3.0, 0.6, -3.0)});
    const uint32_t floor = addMesh(scene, makePrimitive("plane", 2, Vec3(0.4f, 0.4f, 0.35f)));
    root.instances.add(ChildRef::mesh(floor), {DMat3(100.0), DVec3(0.0)});
    scene.groups.push_back(std::move(root));
    scene.root = 0;
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

FrameRequest request(bool orthographic) {
    FrameRequest r;
    r.camera = lookAt(DVec3(0.3, 2.0, 9.0), DVec3(0.2, 1.4, 0.0));
    r.camera.orthographic = orthographic;
    r.camera.height = 6.0;
    r.settings.width = 200;
    r.settings.height = 150;
    r.settings.reconstruct = Reconstruct::kBins;
    return r;
}

Image render(const Scene& scene, const FrameRequest& r, int threads = 2) {
    ThreadPool pool(threads);
    return Renderer(scene, pool).render(r).image;
}

// Where they cross they are as near to each other as one surface is to itself.
TEST(BinsImage, crossingPanesAreTwoLayersEverywhere) {
    for (const int triangles : {2, 2000}) {
        TestScene test;
        for (const double turn : {0.5, -0.4}) {
            const double c = std::cos(turn), s = std::sin(turn);
            Affine at;
            at.linear = DMat3(DVec3(c, 0, s), DVec3(-s, 0, c), DVec3(0, 1, 0)) * 4.0;
            at.translation = DVec3(0.013, 0.0, 0.0);
            test.add(makePrimitive("plane", triangles, Vec3(0.5f), 0.3f), at);
        }
        const Scene& scene = test.build();
        FrameRequest r = request(false);
        r.camera = lookAt(DVec3(0.0, 0.0, 6.0), DVec3(0.0, 0.0, 0.0));
        r.settings.samples = 1;
        r.aovs = {"coverage"};
        const Image image = render(scene, r);
        const int coverage = image.channelIndex("coverage");
        for (int y = 40; y < 110; ++y) {
            for (int x = 70; x < 130; ++x)
                ASSERT_NEAR(image.pixel(x, y)[coverage], 0.51f, 0.01f) << x << "," << y;
        }
    }
}

TEST(BinsImage, layersLookAsManyRaysSeeThem) {
    const Scene scene = glassScene();
    ThreadPool pool(2);
    for (const bool orthographic : {false, true}) {
        FrameRequest r = request(orthographic);
        r.settings.method = Method::kRaycast;
        r.settings.samples = 256;
        const Image rays = render(scene, r);
        r.settings.method = Method::kPoints;
        r.settings.samples = RenderSettings().samples;
        for (const double threshold : {RenderSettings().area_threshold, 1e6}) {
            r.settings.area_threshold = threshold;  // the higher, the more are points
            const CompareResult result = compareImages(render(scene, r), rays, pool);
            EXPECT_GT(result.psnr, 30.0) << "orthographic " << orthographic << ", " << threshold;
        }
        // What hides behind one layer is lost by the others: the test would see it.
        r.settings.area_threshold = RenderSettings().area_threshold;
        r.settings.reconstruct = Reconstruct::kGaussian;
        EXPECT_LT(compareImages(render(scene, r), rays, pool).psnr, 28.0);
    }
}

TEST(BinsImage, sameBitsForAnyThreadsAndWithoutCulling) {
    const Scene scene = glassScene();
    FrameRequest r = request(false);
    const Image one = render(scene, r, 1);
    for (const int threads : {2, 7}) EXPECT_EQ(render(scene, r, threads).data, one.data);
    r.settings.culling = false;
    EXPECT_EQ(render(scene, r).data, one.data);
}

enum class Leaves { kOpaque, kTranslucent, kPictures };

// Trees on a lattice, those far away finer than a pixel.
Scene wood(Leaves leaves) {
    TestScene t;
    t.scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(2.5f)});
    for (const char* species : {"oak", "spruce"}) {
        TreeParams params;
        params.species = species;
        params.height = 14.0;
        params.triangles = 6000;
        GeneratedMesh tree = makeTree(params);
        Material& leaf = tree.materials[1];
        if (leaves != Leaves::kOpaque) leaf.alpha_mode = AlphaMode::kBlend;
        if (leaves == Leaves::kTranslucent) leaf.alpha = 0.5f;
        if (leaves == Leaves::kPictures) {
            // Each leaf shows a round one with a soft border.
            constexpr int kSide = 16;
            Texture picture;
            picture.levels.push_back({kSide, kSide, {}});
            for (int i = 0; i < kSide * kSide; ++i) {
                const float r = std::hypot(float(i % kSide) - 7.5f, float(i / kSide) - 7.5f);
                const auto alpha = uint8_t(std::clamp(255.0f * (8.0f - r) / 3.0f, 0.0f, 255.0f));
                picture.levels[0].rgba.insert(picture.levels[0].rgba.end(), {255, 255, 255, alpha});
            }
            buildMipmaps(picture);
            leaf.base_texture = int(t.scene.textures.size());
            t.scene.textures.push_back(std::move(picture));
            // A corner of the picture for each corner of a leaf.
            tree.mesh.uvs.resize(tree.mesh.positions.size());
            for (size_t i = 0; i < tree.mesh.triangles.size(); ++i) {
                const UVec3& corners = tree.mesh.triangles[i];
                for (int k = 0; k < 3; ++k)
                    tree.mesh.uvs[corners[k]] =
                        Vec2(float(corners[k] % 4 / 2), float((corners[k] % 4 + 1) % 4 / 2));
            }
        }
        addMesh(t.scene, std::move(tree));
    }
    for (int i = 0; i < 400; ++i) {
        const double x = 6.0 * (i % 20 - 9.5) + 2.0 * std::sin(37.0 * i),
                     z = -5.0 * (i / 20) + 2.0 * std::sin(91.0 * i);
        t.root.instances.add(
            ChildRef::mesh(uint32_t(i % 3 == 0)),
            placed(DVec3(x, 0.0, z), DVec3(1.0 + 0.2 * std::sin(7.0 * i)), 2.4 * i));
    }
    t.add(makePrimitive("plane", 2, Vec3(0.35f, 0.3f, 0.2f)), placed(DVec3(0.0), DVec3(400.0)));
    return std::move(t.build());
}

TEST(BinsImage, canopiesLookAsManyRaysSeeThem) {
    ThreadPool pool(2);
    for (const Leaves leaves : {Leaves::kOpaque, Leaves::kTranslucent, Leaves::kPictures}) {
        const Scene scene = wood(leaves);
        FrameRequest r = request(false);
        r.camera = lookAt(DVec3(0.0, 26.0, 32.0), DVec3(0.0, 6.0, -16.0));
        r.settings.width = 120;
        r.settings.height = 90;
        const Image points = render(scene, r);
        r.settings.method = Method::kRaycast;
        r.settings.samples = 256;
        EXPECT_GE(compareImages(points, render(scene, r), pool).psnr, 30.0) << int(leaves);
    }
}

}  // namespace
}  // namespace stipple
