// SPDX-License-Identifier: Apache-2.0
// Pictures thrown onto surfaces: where they should land, with their shadows, beside rays; and what
// two projectors have to throw on a bent screen so that a viewer sees a straight picture.
#include "test_scene.h"

#include <gtest/gtest.h>
#include <render/compare.h>

namespace stipple {
namespace {

// White lines, a few pixels wide, every kGap pixels, on blue.
constexpr int kGap = 40, kLine = 4;
Texture linePicture(int width, int height) {
    Texture t;
    t.levels.push_back({width, height, {}});
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const bool is_line = x % kGap >= kGap - kLine;
            t.levels[0].rgba.insert(t.levels[0].rgba.end(), {uint8_t(is_line ? 255 : 0),
                                                             uint8_t(is_line ? 255 : 0), 255, 255});
        }
    }
    t.wrap_u = t.wrap_v = Wrap::kClamp;
    buildMipmaps(t);
    return t;
}

// What was drawn, as the bytes of a PNG have it.
Texture pictureOf(const Image& image) {
    Texture t;
    t.levels.push_back({image.width, image.height, {}});
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            const float* p = image.pixel(x, y);
            for (int c = 0; c < 3; ++c) {
                t.levels[0].rgba.push_back(
                    uint8_t(std::clamp(srgbFromLinear(p[c]), 0.0f, 1.0f) * 255.0f + 0.5f));
            }
            t.levels[0].rgba.push_back(255);
        }
    }
    t.wrap_u = t.wrap_v = Wrap::kClamp;
    buildMipmaps(t);
    return t;
}

Projector projectorAt(const Camera& camera, Texture picture,
                      ProjectorMode mode = ProjectorMode::kReplace) {
    Projector projector;
    projector.view = makeView(camera, picture.levels[0].width, picture.levels[0].height, 1);
    projector.picture = std::make_shared<const Texture>(std::move(picture));
    projector.mode = mode;
    return projector;
}

// Surfaces show their colour as it is.
void lightEvenly(Scene& scene) {
    Sky& sky = scene.lighting.sky;
    sky.zenith = sky.horizon = sky.ground = Vec3(1.0f);
}

FrameRequest request(const Camera& camera, Method method = Method::kPoints) {
    FrameRequest r;
    r.camera = camera;
    r.settings.width = 320, r.settings.height = 240;
    r.settings.method = method;
    if (method == Method::kRaycast) r.settings.samples = 16;
    return r;
}
Image render(const Scene& scene, const FrameRequest& r) {
    ThreadPool pool(2);
    return Renderer(scene, pool).render(r).image;
}

TEST(Projectors, thePictureIsSeenAsItIsFromTheProjector) {
    TestScene t;
    t.add(makePrimitive("plane", 2, Vec3(0.5f)), placed(DVec3(0, 0, 0), DVec3(40.0)));
    t.add(makePrimitive("sphere", 20000, Vec3(0.5f)), placed(DVec3(0, 1, 0), DVec3(3.0)));
    Scene& scene = t.build();
    lightEvenly(scene);
    const Camera camera = lookAt(DVec3(2, 7, 9), DVec3(0, 0, 0));
    const Texture picture = linePicture(320, 240);
    ThreadPool pool(2);
    for (const ProjectorMode mode : {ProjectorMode::kReplace, ProjectorMode::kModulate}) {
        scene.lighting.projectors = {projectorAt(camera, picture, mode)};
        for (const Method method : {Method::kPoints, Method::kZBuffer, Method::kRaycast}) {
            FrameRequest r = request(camera, method);
            const float gray = mode == ProjectorMode::kReplace ? 1.0f : 0.5f;
            Image expected = render(scene, r);
            for (int y = 0; y < 240; ++y) {
                for (int x = 0; x < 320; ++x) {
                    float* p = expected.pixel(x, y);
                    // Interpolated between texels and averaged over a pixel.
                    const auto lineAt = [](int u) {
                        return std::clamp(u, 0, 319) % kGap >= kGap - kLine ? 1.0f : 0.0f;
                    };
                    p[0] = p[1] = gray * (0.75f * lineAt(x) + 0.125f * lineAt(x - 1) +
                                          0.125f * lineAt(x + 1));
                    p[2] = gray;
                }
            }
            EXPECT_GE(compareImages(render(scene, r), expected, pool).psnr, 32.0);
        }
    }
}

TEST(Projectors, nothingLandsBesideTheBeamBehindOrOnSidesThatFaceAway) {
    TestScene t;
    t.add(makePrimitive("plane", 2, Vec3(0.5f)), placed(DVec3(0, 0, 0), DVec3(40.0)));
    Scene& scene = t.build();
    lightEvenly(scene);
    const FrameRequest r = request(lookAt(DVec3(0, 10, 10), DVec3(0)));
    const Image plain = render(scene, r);
    const Texture picture = linePicture(64, 64);
    // Away from the floor; from below it; onto what is not in view.
    for (const Camera& camera :
         {lookAt(DVec3(0, 5, 0), DVec3(0, 9, 1)), lookAt(DVec3(0, -5, 0), DVec3(0, 0, 1)),
          lookAt(DVec3(18, 1, -18), DVec3(19, 0, -19))}) {
        scene.lighting.projectors = {projectorAt(camera, picture)};
        EXPECT_EQ(render(scene, r).data, plain.data);
    }
}

TEST(Projectors, shadowsAreThoseOfRays) {
    TestScene t;
    t.add(makePrimitive("plane", 2, Vec3(0.5f)), placed(DVec3(0, 0, 0), DVec3(40.0)));
    t.add(makePrimitive("box", 12, Vec3(0.8f, 0.4f, 0.2f)),
          placed(DVec3(0.5, 1.0, 0), DVec3(2.0), 0.4));
    Scene& scene = t.build();
    lightEvenly(scene);
    scene.lighting.projectors = {
        projectorAt(lookAt(DVec3(-7, 6, 3), DVec3(0, 0, 0)), linePicture(320, 240))};
    FrameRequest r = request(lookAt(DVec3(4, 6, 8), DVec3(0.5, 0, 0)));
    ThreadPool pool(2);
    r.settings.shadows = true;
    const Image points = render(scene, r);
    r = request(r.camera, Method::kRaycast);
    const Image open = render(scene, r);
    r.settings.shadows = true;
    const Image rays = render(scene, r);
    EXPECT_GE(compareImages(points, rays, pool).psnr, 28.0);
    EXPECT_LT(compareImages(points, open, pool).psnr, 24.0);  // there is a shadow
}

TEST(Projectors, twoOfThemThrowAStraightPictureOntoABentScreen) {
    // The side of a cylinder that bulges towards the viewer.
    Mesh screen;
    constexpr int kColumns = 200;
    for (int i = 0; i <= kColumns; ++i) {
        const double a = (double(i) / kColumns - 0.5) * 2.0;
        for (const double y : {-4.0, 4.0}) {
            screen.positions.push_back(Vec3(DVec3(5.0 * std::sin(a), y, 5.0 * std::cos(a) - 5.0)));
            screen.normals.push_back(Vec3(DVec3(std::sin(a), 0.0, std::cos(a))));
        }
    }
    for (uint32_t i = 0; i < kColumns; ++i) {
        screen.triangles.push_back(UVec3(2 * i, 2 * i + 2, 2 * i + 1));
        screen.triangles.push_back(UVec3(2 * i + 1, 2 * i + 2, 2 * i + 3));
    }
    screen.triangle_material.assign(screen.triangles.size(), 0);
    GeneratedMesh made;
    made.mesh = std::move(screen);
    made.materials.emplace_back();
    made.materials[0].base_color = Vec3(0.02f);
    TestScene t;
    t.add(std::move(made), placed(DVec3(0)));
    Scene& scene = t.build();
    lightEvenly(scene);

    Camera viewer = lookAt(DVec3(0, 0.5, 10), DVec3(0, 0, 0));
    viewer.fov_y = 0.5;
    const Camera left = lookAt(DVec3(-5, 1, 8), DVec3(-1.4, 0, 0)),
                 right = lookAt(DVec3(5, -1, 8), DVec3(1.4, 0, 0));
    // What each has to throw is what it would see of the viewer's picture.
    scene.lighting.projectors = {projectorAt(viewer, linePicture(320, 240))};
    std::vector<Projector> corrected;
    for (const Camera& camera : {left, right}) {
        FrameRequest r = request(camera);
        r.settings.width = 1280, r.settings.height = 960;
        corrected.push_back(projectorAt(camera, pictureOf(render(scene, r))));
    }
    scene.lighting.projectors = std::move(corrected);
    const Image seen = render(scene, request(viewer));
    int lines = 0;
    for (int y = 20; y < 220; ++y) {
        for (int line = 1; line < 7; ++line) {
            // Its middle, and how much of it there is.
            const float end = float(kGap * line), middle = end - 0.5f * kLine;
            float sum = 0.0f, moment = 0.0f;
            for (int x = int(middle) - kGap / 2; x < int(middle) + kGap / 2; ++x) {
                const float red = seen.pixel(x, y)[0];
                sum += red, moment += red * (float(x) + 0.5f);
            }
            ASSERT_NEAR(sum, float(kLine), 0.5f) << line << " in row " << y;
            ASSERT_NEAR(moment / sum, middle, 0.5f) << line << " in row " << y;
            ++lines;
        }
    }
    EXPECT_EQ(lines, 1200);
    // Without correction the picture is not straight.
    scene.lighting.projectors = {projectorAt(left, linePicture(320, 240))};
    ThreadPool pool(2);
    EXPECT_LT(compareImages(render(scene, request(viewer)), seen, pool).psnr, 15.0);
}

}  // namespace
}  // namespace stipple
