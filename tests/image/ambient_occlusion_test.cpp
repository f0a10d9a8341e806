// SPDX-License-Identifier: Apache-2.0
// Ambient occlusion from a picture of depths against rays: dark where surfaces meet, nothing on a
// plane, crowns as bright as by rays; the same bits for any number of threads.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <tests/image/test_scene.h>

namespace stipple {
namespace {

constexpr int kWidth = 320, kHeight = 200;

// A plane of so many triangles, and what stands on it, under the sky alone.
struct OcclusionScene : TestScene {
    explicit OcclusionScene(int plane_triangles = 2) {
        add(makePrimitive("plane", plane_triangles, Vec3(0.5f)), placed(DVec3(0.0), DVec3(100.0)));
    }
};

FrameRequest request(const DVec3& eye, const DVec3& target) {
    FrameRequest r;
    r.camera = lookAt(eye, target);
    r.settings.width = kWidth;
    r.settings.height = kHeight;
    return r;
}

Image render(const Scene& scene, FrameRequest r, Method method, bool ao, int threads = 2) {
    r.settings.method = method;
    r.settings.ao = ao;
    if (method == Method::kRaycast) r.settings.samples = 16;
    ThreadPool pool(threads);
    return Renderer(scene, pool).render(r).image;
}

// Mean share of the light that `ao` leaves in a square of pixels about the place where a point of
// the world is seen.
double leftAt(const Image& ao, const Image& open, const FrameRequest& r, const DVec3& p_world) {
    constexpr int kRadius = 2;
    const View view = makeView(r.camera, kWidth, kHeight, 1);
    const Vec2 at = view.project(Vec3(view.camera_from_world * (p_world - view.eye_world)));
    double dark = 0.0, bright = 0.0;
    for (int y = int(at.y) - kRadius; y <= int(at.y) + kRadius; ++y) {
        for (int x = int(at.x) - kRadius; x <= int(at.x) + kRadius; ++x) {
            dark += ao.pixel(x, y)[1];
            bright += open.pixel(x, y)[1];
        }
    }
    return dark / bright;
}

TEST(AmbientOcclusion, darkensWhereABoxMeetsAPlane) {
    OcclusionScene t;
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 1.5, 0), DVec3(3.0)));
    const Scene& scene = t.build();
    const FrameRequest r = request(DVec3(3, 4, 9), DVec3(0, 0.6, 0));
    const Image open = render(scene, r, Method::kRaycast, false);
    const Image rays = render(scene, r, Method::kRaycast, true);
    // On the plane before the box, and on the box; the last lie farther off than the radius.
    const DVec3 places[] = {{0, 0, 1.7},   {0, 0, 2.0}, {0, 0, 2.5},  {0, 0.2, 1.5},
                            {0, 0.7, 1.5}, {0, 0, 4.0}, {0, 2.5, 1.5}};
    EXPECT_LT(leftAt(rays, open, r, places[0]), 0.65);
    EXPECT_LT(leftAt(rays, open, r, places[3]), 0.7);
    EXPECT_NEAR(leftAt(rays, open, r, places[5]), 1.0, 1e-6);
    for (const Method method : {Method::kPoints, Method::kZBuffer}) {
        const Image picture = render(scene, r, method, true);
        for (const DVec3& place : places) {
            EXPECT_NEAR(leftAt(picture, open, r, place), leftAt(rays, open, r, place), 0.08)
                << place.y << " " << place.z;
        }
    }
}

// Seen from above and grazing, as two large triangles and as points.
TEST(AmbientOcclusion, leavesAPlaneAsItIs) {
    for (const int triangles : {2, 400000}) {
        OcclusionScene t(triangles);
        const Scene& scene = t.build();
        for (const double height : {1.0, 8.0, 30.0}) {
            const FrameRequest r = request(DVec3(0, height, 40), DVec3(0, 0, 0));
            for (const Method method : {Method::kPoints, Method::kRaycast}) {
                const TileMeans means =
                    tileMeans(render(scene, r, method, true), render(scene, r, method, false));
                EXPECT_LT(means.max, 0.002) << triangles << " " << height;
            }
        }
    }
}

TEST(AmbientOcclusion, wallsHaveNoInside) {
    OcclusionScene t;
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 50, 0), DVec3(3.0)));
    const Scene& scene = t.build();
    const FrameRequest r = request(DVec3(3, 52, 9), DVec3(0, 50, 0));
    const Image open = render(scene, r, Method::kRaycast, false);
    EXPECT_EQ(render(scene, r, Method::kRaycast, true).data, open.data);
}

Scene wood() {
    OcclusionScene t;
    TreeParams params;
    params.triangles = 4000;
    const uint32_t tree = addMesh(t.scene, makeTree(params));
    for (int i = 0; i < 100; ++i) {
        t.root.instances.add(ChildRef::mesh(tree),
                             placed(DVec3(6.0 * (i % 10) - 27.0, 0.0, -6.0 * (i / 10))));
    }
    return t.build();
}

TEST(AmbientOcclusion, treesAreAsBrightAsByRays) {
    const Scene scene = wood();
    const FrameRequest r = request(DVec3(0, 30, 70), DVec3(0, 4, -20));
    const Image rays = render(scene, r, Method::kRaycast, true);
    const Image points = render(scene, r, Method::kPoints, true);
    const TileMeans means = tileMeans(points, rays);
    EXPECT_NEAR(means.mean, 0.0, 0.01);
    EXPECT_LT(means.rms, 0.03);
    const TileMeans without = tileMeans(render(scene, r, Method::kRaycast, false), rays);
    EXPECT_GT(without.mean, 0.05);  // there is something to see
}

TEST(AmbientOcclusion, sameBitsForAnyNumberOfThreadsAndTiles) {
    const Scene scene = wood();
    FrameRequest r = request(DVec3(0, 30, 70), DVec3(0, 4, -20));
    r.settings.ao_rays = 4;
    for (const Method method : {Method::kPoints, Method::kRaycast}) {
        const Image one = render(scene, r, method, true, 1);
        for (const int threads : {2, 7})
            EXPECT_EQ(one.data, render(scene, r, method, true, threads).data);
    }
    const Image before = render(scene, r, Method::kZBuffer, true);
    r.settings.tile_size = 128;
    EXPECT_EQ(before.data, render(scene, r, Method::kZBuffer, true).data);
}

TEST(AmbientOcclusion, everyReconstructionAndOrthographicCamerasTakeIt) {
    OcclusionScene t;
    t.add(makePrimitive("box", 12, Vec3(0.6f)), placed(DVec3(0, 1.5, 0), DVec3(3.0)));
    const Scene& scene = t.build();
    FrameRequest r = request(DVec3(3, 4, 9), DVec3(0, 0.6, 0));
    r.camera.orthographic = true;
    r.camera.height = 8.0;
    const Image rays = render(scene, r, Method::kRaycast, true);
    ThreadPool pool(2);
    for (const Reconstruct reconstruct :
         {Reconstruct::kPerPixel, Reconstruct::kSplat, Reconstruct::kGaussian,
          Reconstruct::kPullPush, Reconstruct::kEwa}) {
        r.settings.reconstruct = reconstruct;
        EXPECT_GT(compareImages(render(scene, r, Method::kPoints, true), rays, pool).psnr, 30.0)
            << int(reconstruct);
    }
}

}  // namespace
}  // namespace stipple
