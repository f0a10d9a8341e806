// SPDX-License-Identifier: Apache-2.0
// Pixels beside the formulas they are made by, one at a time.
#include <gtest/gtest.h>
#include <reconstruct/picture.h>
#include <reconstruct/shade.h>

namespace stipple {
namespace {

constexpr int kWidth = 75, kHeight = 40;

View viewTo(const DVec3& forward, bool orthographic, int subpixels) {
    Camera camera = lookAt(DVec3(1, 2, 3), DVec3(1, 2, 3) + forward);
    camera.orthographic = orthographic;
    camera.fov_y = 1.9;
    return makeView(camera, kWidth, kHeight, subpixels);
}

Lighting lightingWith(bool environment) {
    Lighting lighting;
    lighting.exposure = 0.7f;
    if (!environment) return lighting;
    auto picture = std::make_shared<Environment>();
    picture->width = 8, picture->height = 4, picture->turn = 0.4f;
    for (int i = 0; i < 32; ++i)
        picture->radiance.emplace_back(0.1f * float(i), 3.0f - 0.05f * float(i), 1.0f);
    prepareEnvironment(*picture);
    lighting.sky.environment = picture;
    return lighting;
}

// What one pixel shows that nothing covers.
Vec3 skyAt(const View& view, const Lighting& lighting, int x, int y) {
    const float s = float(view.subpixels);
    Vec3 origin, direction;
    view.ray((float(x) + 0.5f) * s, (float(y) + 0.5f) * s, origin, direction);
    const Mat3 world_from_camera(glm::transpose(view.camera_from_world));
    return skyRadiance(lighting.sky, glm::normalize(world_from_camera * direction)) *
           std::exp2(lighting.exposure);
}

void expectColour(const Picture& picture, int x, int y, const Vec3& expected) {
    const float* pixel = const_cast<Picture&>(picture).image().pixel(x, y);
    for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(pixel[c], expected[c], 2e-6f * (1.0f + expected[c])) << x << "," << y;
    ASSERT_EQ(pixel[3], 1.0f);
}

TEST(ReconstructPicture, theSkyOfARowIsThatOfItsPixels) {
    for (const bool environment : {false, true}) {
        for (const bool orthographic : {false, true}) {
            for (const DVec3& forward : {DVec3(0.2, 0, -1), DVec3(0.1, -1, 0), DVec3(0, 1, 0.3)}) {
                const View view = viewTo(forward, orthographic, 2);
                const Lighting lighting = lightingWith(environment);
                // Written by runs, from right to left, and from the middle on: rows of the sky
                // begin anywhere.
                for (const int from : {0, 17, kWidth - 1}) {
                    Picture picture(view, lighting, {}, false);
                    SkyRow sky;
                    PixelSums nothing;
                    nothing.samples = 4.0f;
                    for (int y = 0; y < kHeight; ++y) {
                        for (int x = from - 1; x >= 0; --x) picture.write(x, y, nothing, sky);
                        picture.writeNothing(from, y, kWidth - from, 4.0f, sky);
                    }
                    for (int y = 0; y < kHeight; ++y) {
                        for (int x = 0; x < kWidth; ++x)
                            expectColour(picture, x, y, skyAt(view, lighting, x, y));
                    }
                }
            }
        }
    }
}

TEST(ReconstructPicture, pixelsWithoutSamplesThatSawAnythingAreTheSameOneByOne) {
    const View view = viewTo(DVec3(0, 0, -1), false, 2);
    for (const bool transparent : {false, true}) {
        for (const auto& aovs :
             {std::vector<std::string>{}, {"depth", "coverage", "normal", "object"}}) {
            Picture one(view, Lighting(), aovs, transparent),
                many(view, Lighting(), aovs, transparent);
            one.watch(5, 7), many.watch(5, 7);
            SkyRow sky_of_one, sky_of_many;
            PixelSums nothing;
            nothing.samples = 4.0f;
            for (int y = 0; y < kHeight; ++y) {
                for (int x = 0; x < kWidth; ++x) one.write(x, y, nothing, sky_of_one);
                many.writeNothing(0, y, kWidth, 4.0f, sky_of_many);
            }
            EXPECT_EQ(one.image().data, many.image().data);
            EXPECT_EQ(one.watchedPixel(), many.watchedPixel());
        }
    }
}

TEST(ReconstructPicture, theSkyShowsThroughWhatIsNotCovered) {
    const View view = viewTo(DVec3(0.2, 0.1, -1), false, 2);
    const Lighting lighting = lightingWith(false);
    Picture picture(view, lighting, {}, false);
    SkyRow sky;
    PixelSums sums;
    sums.radiance = Vec3(0.75f, 0.5f, 0.25f);
    sums.covered = 1.0f, sums.samples = 4.0f;
    picture.write(3, 4, sums, sky);
    expectColour(
        picture, 3, 4,
        0.75f * skyAt(view, lighting, 3, 4) + 0.25f * sums.radiance * std::exp2(lighting.exposure));
}

}  // namespace
}  // namespace stipple
