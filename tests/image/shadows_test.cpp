// SPDX-License-Identifier: Apache-2.0
// Shadow maps against shadow rays: edges where they belong, nothing lit in the shade and no shade
// in the light; the same bits for any number of threads.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <tests/image/test_scene.h>

namespace stipple {
namespace {

constexpr int kWidth = 320, kHeight = 200;

// A plane, and what stands on it.
struct ShadowScene : TestScene {
    explicit ShadowScene(const Vec3& to_sun) : ShadowScene() {
        scene.lighting.suns.push_back({glm::normalize(to_sun), Vec3(3.0f)});
    }
    explicit ShadowScene(const PointLight& lamp) : ShadowScene() {
        scene.lighting.points.push_back(lamp);
    }
    ShadowScene() { add(makePrimitive("plane", 2, Vec3(0.5f)), placed(DVec3(0.0), DVec3(400.0))); }
};

FrameRequest request(const DVec3& eye = DVec3(3, 4, 9)) {
    FrameRequest r;
    r.camera = lookAt(eye, DVec3(0, 0.6, 0));
    r.settings.width = kWidth;
    r.settings.height = kHeight;
    return r;
}

Image render(const Scene& scene, FrameRequest r, Method method, bool shadows, int threads = 2) {
    r.settings.method = method;
    r.settings.shadows = shadows;
    if (method == Method::kRaycast) r.settings.samples = 16;
    ThreadPool pool(threads);
    return Renderer(scene, pool).render(r).image;
}

// Whether the green channel differs by no more than `tolerance` within `radius` pixels.
bool isEven(const Image& image, int x, int y, int radius, float tolerance) {
    float low = kInfinity, high = -kInfinity;
    for (int v = std::max(y - radius, 0); v <= std::min(y + radius, kHeight - 1); ++v) {
        for (int u = std::max(x - radius, 0); u <= std::min(x + radius, kWidth - 1); ++u) {
            low = std::min(low, image.pixel(u, v)[1]);
            high = std::max(high, image.pixel(u, v)[1]);
        }
    }
    return high - low <= tolerance * high;
}

// An edge farther off than 1.5 pixels would show in a pixel whose neighbours, two pixels around,
// are all lit or all in the shade; so would light under the box, or false shadow on the plane.
void expectShadowsOfRays(const Scene& scene, int least_lit, int least_shaded) {
    const Image rays = render(scene, request(), Method::kRaycast, true);
    const Image open = render(scene, request(), Method::kRaycast, false);
    for (const Method method : {Method::kPoints, Method::kZBuffer}) {
        const Image maps = render(scene, request(), method, true);
        int lit = 0, shaded = 0, wrong = 0;
        for (int y = 0; y < kHeight; ++y) {
            for (int x = 0; x < kWidth; ++x) {
                const float expected = rays.pixel(x, y)[1], unshaded = open.pixel(x, y)[1];
                if (!isEven(rays, x, y, 2, 0.05f) || !isEven(open, x, y, 2, 0.05f)) continue;
                (expected < 0.9f * unshaded ? shaded : lit) += 1;
                wrong += std::abs(maps.pixel(x, y)[1] - expected) > 0.03f * expected;
            }
        }
        EXPECT_GT(lit, least_lit);
        EXPECT_GT(shaded, least_shaded);
        EXPECT_EQ(wrong, 0);
        ThreadPool pool(2);
        EXPECT_GT(compareImages(maps, rays, pool).psnr, 28.0);
    }
}

class ShadowOfBox : public testing::TestWithParam<float> {};

TEST_P(ShadowOfBox, liesWhereRaysHaveIt) {
    ShadowScene t(Vec3(-1.0f, GetParam(), 0.3f));
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 1.5, 0), DVec3(3.0), 0.5));
    expectShadowsOfRays(t.build(), 20000, 400);
}

// The shadow's far edge: there a texel of the sun's width would cover four pixels of the plane.
TEST(Shadows, ofASlabUnderALowSunLiesWhereRaysHaveIt) {
    for (const double height : {0.15, 0.3, 0.5}) {
        ShadowScene t(Vec3(-1.0f, 0.25f, 0.3f));
        t.add(makePrimitive("box", 12, Vec3(0.6f)),
              placed(DVec3(0, 0.5 * height, 0), DVec3(3.0, height, 3.0)));
        expectShadowsOfRays(t.build(), 20000, 20);
    }
}

INSTANTIATE_TEST_SUITE_P(heights, ShadowOfBox, testing::Values(2.0f, 0.7f, 0.25f));

PointLight spotAt(const DVec3& place, const DVec3& target) {
    PointLight lamp;
    lamp.position = place;
    lamp.intensity = Vec3(120.0f);
    lamp.is_spot = true;
    lamp.axis = glm::normalize(Vec3(target - place));
    lamp.inner_cone = 0.5f;
    return lamp;
}

PointLight lampAt(const DVec3& place) {
    PointLight lamp;
    lamp.position = place;
    lamp.intensity = Vec3(60.0f);
    return lamp;
}

class ShadowOfLamp : public testing::TestWithParam<PointLight> {};

// The plane begins behind the lamp where it shines aside.
TEST_P(ShadowOfLamp, liesWhereRaysHaveIt) {
    ShadowScene t(GetParam());
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 0.75, 0), DVec3(1.5), 0.5));
    expectShadowsOfRays(t.build(), 10000, 400);
}

INSTANTIATE_TEST_SUITE_P(lamps, ShadowOfLamp,
                         testing::Values(spotAt(DVec3(-4, 4, 1), DVec3(0, 0.5, 0)),
                                         lampAt(DVec3(-3, 4, 1)), lampAt(DVec3(-2.2, 1.2, 0.9))));

// A ball's lit side has no shadow of its own, and its far side no light, but for the pixels where
// the light grazes it.
TEST(Shadows, curvedSurfacesHaveNoAcne) {
    ShadowScene t(Vec3(-1.0f, 0.8f, 0.6f));
    t.add(makePrimitive("sphere", 80000, Vec3(0.6f)), placed(DVec3(0, 1.2, 0), DVec3(2.4)));
    const Scene& scene = t.build();
    FrameRequest r = request();
    r.aovs = {"normal"};
    const Image rays = render(scene, r, Method::kRaycast, true);
    const Image open = render(scene, r, Method::kRaycast, false);
    const Image maps = render(scene, r, Method::kPoints, true);
    const int up = rays.channelIndex("normal.Y");
    ASSERT_GE(up, 0);
    int compared = 0;
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            const float expected = rays.pixel(x, y)[1];
            const bool is_plane = rays.pixel(x, y)[up] > 0.999f;
            if (is_plane || !isEven(rays, x, y, 2, 0.2f) || !isEven(open, x, y, 2, 0.2f)) continue;
            ++compared;
            EXPECT_NEAR(maps.pixel(x, y)[1], expected, 0.04f * expected) << x << ", " << y;
        }
    }
    EXPECT_GT(compared, 2000);
}

TEST(Shadows, whatStandsBehindTheCameraShadesWhatItSees) {
    ShadowScene t(Vec3(0.0f, 0.5f, 1.0f));  // from behind the camera
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 40, 60), DVec3(200, 80, 2)));
    const Scene& scene = t.build();
    const Image rays = render(scene, request(), Method::kRaycast, true);
    const Image open = render(scene, request(), Method::kPoints, false);
    const Image maps = render(scene, request(), Method::kPoints, true);
    const int x = kWidth / 2, y = kHeight * 3 / 4;
    EXPECT_LT(rays.pixel(x, y)[1], 0.8f * open.pixel(x, y)[1]);
    EXPECT_NEAR(maps.pixel(x, y)[1], rays.pixel(x, y)[1], 0.01f * rays.pixel(x, y)[1]);
}

// Trees in a group that is placed twice, or the same trees in one flat group.
Scene wood(bool is_nested) {
    ShadowScene t(Vec3(-1.0f, 0.9f, 0.4f));
    TreeParams params;
    params.triangles = 4000;
    const uint32_t tree = addMesh(t.scene, makeTree(params));
    Group stand;
    stand.instances = InstanceStore(DBox3{DVec3(-200), DVec3(200)});
    for (int i = 0; i < 100; ++i) {
        stand.instances.add(
            ChildRef::mesh(tree),
            placed(DVec3(7.0 * (i % 10) - 35.0, 0.0, -7.0 * (i / 10)), DVec3(1.0), 2.4 * i));
    }
    if (is_nested) t.scene.groups.push_back(stand);
    for (const double x : {-40.0, 40.0}) {
        const Affine at = placed(DVec3(x, 0, 0), DVec3(1.0), x > 0.0 ? 0.3 : 0.0);
        if (is_nested) {
            t.root.instances.add(ChildRef::group(0), at);
        } else {
            for (uint32_t i = 0; i < 100; ++i)
                t.root.instances.add(ChildRef::mesh(tree), at * stand.instances.groupFromChild(i));
        }
    }
    return t.build();
}

FrameRequest woodRequest() {
    FrameRequest r;
    r.camera = lookAt(DVec3(0, 60, 110), DVec3(0, 6, -20));
    r.settings.width = kWidth;
    r.settings.height = kHeight;
    return r;
}

TEST(Shadows, raysFindCastersInNestedGroups) {
    const Image nested = render(wood(true), woodRequest(), Method::kRaycast, true);
    const Image flat = render(wood(false), woodRequest(), Method::kRaycast, true);
    ThreadPool pool(2);
    EXPECT_GT(compareImages(nested, flat, pool).psnr, 45.0);
}

TEST(Shadows, treesAreAsBrightAsByRays) {
    const Scene scene = wood(true);
    const Image rays = render(scene, woodRequest(), Method::kRaycast, true);
    const Image maps = render(scene, woodRequest(), Method::kPoints, true);
    ThreadPool pool(2);
    const TileMeans means = tileMeans(maps, rays);
    EXPECT_NEAR(means.mean, 0.0, 0.01);
    EXPECT_LT(means.rms, 0.03);
    EXPECT_GT(compareImages(maps, rays, pool).psnr, 28.0);
    const TileMeans without =
        tileMeans(render(scene, woodRequest(), Method::kRaycast, false), rays);
    EXPECT_GT(without.mean, 0.05);  // there is something to see
}

// One shines from within the trees to all sides, one from above.
Scene woodByNight() {
    Scene scene = wood(true);
    scene.lighting.suns.clear();
    scene.lighting.sky.zenith = scene.lighting.sky.horizon = Vec3(0.02f);
    PointLight within = lampAt(DVec3(-36.0, 5.0, 4.0)),
               above = spotAt(DVec3(60, 50, 20), DVec3(30, 0, -20));
    within.intensity = Vec3(1500.0f);
    above.intensity = Vec3(20000.0f);
    scene.lighting.points = {within, above};
    return scene;
}

TEST(Shadows, treesUnderLampsAreAsBrightAsByRays) {
    const Scene scene = woodByNight();
    const Image rays = render(scene, woodRequest(), Method::kRaycast, true);
    const Image maps = render(scene, woodRequest(), Method::kPoints, true);
    ThreadPool pool(2);
    const TileMeans means = tileMeans(maps, rays);
    EXPECT_NEAR(means.mean, 0.0, 0.02);
    EXPECT_LT(means.rms, 0.05);
    EXPECT_GT(compareImages(maps, rays, pool).psnr, 28.0);
    const TileMeans without =
        tileMeans(render(scene, woodRequest(), Method::kRaycast, false), rays);
    EXPECT_GT(without.mean, 0.05);
}

TEST(Shadows, sameBitsForAnyNumberOfThreads) {
    Scene scene = wood(true);
    scene.lighting.points = woodByNight().lighting.points;
    for (const Method method : {Method::kPoints, Method::kRaycast}) {
        const Image one = render(scene, woodRequest(), method, true, 1);
        EXPECT_EQ(one.data, render(scene, woodRequest(), method, true, 3).data);
    }
}

// Texels lie still in the world: where the camera goes aside by whole pixels, so does the picture.
TEST(Shadows, doNotSwimWhenTheCameraMoves) {
    ShadowScene t(Vec3(-1.0f, 0.7f, 0.3f));
    TreeParams params;
    params.triangles = 4000;
    params.height = 6.0;
    t.add(makeTree(params), placed(DVec3(0.0), DVec3(1.0)));
    const Scene& scene = t.build();
    FrameRequest r = request();
    r.camera = lookAt(DVec3(0, 30, 0), DVec3(0.0), DVec3(0, 0, -1));
    r.camera.orthographic = true;
    r.camera.height = 10.0;
    const Image before = render(scene, r, Method::kZBuffer, true);
    constexpr int kMoved = 7;  // pixels
    r.camera.eye += r.camera.world_from_camera[0] * (kMoved * r.camera.height / kHeight);
    const Image after = render(scene, r, Method::kZBuffer, true);
    int changed = 0, shaded = 0;
    const float lit = before.pixel(2, 2)[1];
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x + kMoved < kWidth; ++x) {
            const float was = before.pixel(x + kMoved, y)[1];
            shaded += was < 0.9f * lit;
            changed += std::abs(after.pixel(x, y)[1] - was) > 0.01f * was;
        }
    }
    EXPECT_GT(shaded, 2000);
    EXPECT_LT(changed, shaded / 100);
}

TEST(Shadows, everyReconstructionTakesThem) {
    ShadowScene t(Vec3(-1.0f, 0.7f, 0.3f));
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 0.75, 0), DVec3(1.5), 0.5));
    const Scene& scene = t.build();
    const Image rays = render(scene, request(), Method::kRaycast, true);
    ThreadPool pool(2);
    for (const Reconstruct reconstruct :
         {Reconstruct::kSplat, Reconstruct::kGaussian, Reconstruct::kPullPush, Reconstruct::kEwa,
          Reconstruct::kBins}) {
        FrameRequest r = request();
        r.settings.reconstruct = reconstruct;
        EXPECT_GT(compareImages(render(scene, r, Method::kPoints, true), rays, pool).psnr, 28.0);
    }
}

// What frames before have drawn is what this one would draw.
TEST(Shadows, keptPagesAreThoseOfAFreshFrame) {
    Scene scene = wood(true);
    scene.lighting.points = woodByNight().lighting.points;
    FrameRequest r = woodRequest();
    r.settings.width = kWidth / 2, r.settings.height = kHeight / 2;
    r.settings.shadows = true;
    ThreadPool pool(2);
    Renderer renderer(scene, pool);
    uint64_t first = 0;
    for (const double x : {0.0, 5.0, -30.0, 5.0}) {
        r.camera = lookAt(DVec3(x, 60, 110), DVec3(0, 6, -20));
        const Frame frame = renderer.render(r);
        EXPECT_EQ(frame.image.data, Renderer(scene, pool).render(r).image.data) << x;
        if (x == 0.0) first = frame.stats.shadow_points;
        EXPECT_GT(first, uint64_t(0));
        if (x == 5.0) {
            EXPECT_LT(frame.stats.shadow_points, first / 2);
        }
    }
    EXPECT_EQ(renderer.render(r).stats.shadow_points, uint64_t(0));
    // What is seen, not how it is drawn, asks for pages.
    r.settings.exposure = 1.0;
    EXPECT_EQ(renderer.render(r).stats.shadow_points, uint64_t(0));
    r.settings.seed = 2;
    EXPECT_EQ(renderer.render(r).image.data, Renderer(scene, pool).render(r).image.data);
}

TEST(Shadows, pagesAreKeptWithinTheirMemory) {
    Scene scene = wood(true);
    FrameRequest r = woodRequest();
    r.settings.shadows = true;
    ThreadPool pool(2);
    Renderer renderer(scene, pool);
    const Frame first = renderer.render(r);
    const auto rendersAgain = [&](int megabytes) {
        r.settings.cache_mb = megabytes;
        renderer.render(r);
        const Frame frame = renderer.render(r);
        EXPECT_EQ(frame.image.data, first.image.data) << megabytes;
        return frame.stats.shadow_points;
    };
    EXPECT_EQ(rendersAgain(256), uint64_t(0));
    EXPECT_EQ(rendersAgain(0), first.stats.shadow_points);
    const uint64_t some = rendersAgain(4);  // 16 pages
    EXPECT_GT(some, uint64_t(0));
    EXPECT_LT(some, first.stats.shadow_points);
}

// One of two balls above a plane, in a group of its own or not, is moved, taken away and brought
// back: its shadow goes with it, and pages that see the other alone stay.
TEST(Shadows, keptPagesFollowEdits) {
    for (const bool is_nested : {false, true}) {
        for (const bool has_lamp : {false, true}) {
            ShadowScene t(Vec3(-1.0f, 0.7f, 0.3f));
            if (has_lamp) {
                t.scene.lighting.suns.clear();
                t.scene.lighting.points.push_back(lampAt(DVec3(-3, 4, 1)));
            }
            const uint32_t ball = addMesh(t.scene, makePrimitive("sphere", 2000, Vec3(0.6f)));
            Group stand;
            stand.instances = InstanceStore(DBox3{DVec3(-200), DVec3(200)});
            stand.instances.add(ChildRef::mesh(ball), placed(DVec3(0, 1.2, 0)));
            if (is_nested) {
                t.scene.groups.push_back(stand);
                t.root.instances.add(ChildRef::group(0), placed(DVec3(0.5, 0, 0)));
            } else {
                t.root.instances.add(ChildRef::mesh(ball), placed(DVec3(0.5, 1.2, 0)));
            }
            t.root.instances.add(ChildRef::mesh(ball), placed(DVec3(-3.5, 0.5, -4)));
            Scene& scene = t.build();
            FrameRequest r = request();
            r.settings.shadows = true;
            ThreadPool pool(2);
            Renderer renderer(scene, pool);
            SceneEditor editor(scene);
            const Frame before = renderer.render(r);
            const auto isRight = [&](const char* what) {
                renderer.sceneChanged(editor.takeChanges());
                const Frame frame = renderer.render(r), fresh = Renderer(scene, pool).render(r);
                EXPECT_LT(frame.stats.shadow_points, fresh.stats.shadow_points) << what;
                EXPECT_GT(compareImages(frame.image, fresh.image, pool).psnr, 60.0) << what;
                return compareImages(frame.image, before.image, pool).psnr;
            };
            const InstanceId id = is_nested ? editor.find({1, 0}) : editor.find({1});
            const ChildRef child = editor.child(id);
            const Affine at = editor.groupFromChild(id);
            Affine aside = at;
            aside.translation += DVec3(1.5, 0.3, -1.0);
            editor.move(id, aside);
            EXPECT_LT(isRight("moved"), 40.0);
            editor.remove(id);
            EXPECT_LT(isRight("removed"), 40.0);
            editor.restore(id, child, at);
            EXPECT_GT(isRight("restored"), 60.0);
        }
    }
}

}  // namespace
}  // namespace stipple
