// SPDX-License-Identifier: Apache-2.0
// Mip chains and lookups against hand-computed values.
#include <core/image.h>
#include <core/material.h>
#include <gtest/gtest.h>

#include <limits>

namespace stipple {
namespace {

// Texture of RGBA bytes, row by row.
Texture makeTexture(int width, int height, std::vector<uint8_t> rgba, bool srgb = false) {
    Texture t;
    t.srgb = srgb;
    t.levels.push_back({width, height, std::move(rgba)});
    return t;
}

void expectNear(const Vec4& value, const Vec4& expected, float tolerance = 1e-5f) {
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(value[c], expected[c], tolerance) << "channel " << c;
}

// Red, green / blue, white.
Texture fourColors() {
    return makeTexture(2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255});
}

TEST(CoreTexture, texelCentresReadTheTexelsTopRowFirst) {
    const Texture t = fourColors();
    expectNear(sampleTexture(t, Vec2(0.25f, 0.25f), 0), Vec4(1, 0, 0, 1));
    expectNear(sampleTexture(t, Vec2(0.75f, 0.25f), 0), Vec4(0, 1, 0, 1));
    expectNear(sampleTexture(t, Vec2(0.25f, 0.75f), 0), Vec4(0, 0, 1, 1));
}

TEST(CoreTexture, interpolatesBetweenTexelCentres) {
    expectNear(sampleTexture(fourColors(), Vec2(0.5f, 0.25f), 0), Vec4(0.5f, 0.5f, 0, 1));
    expectNear(sampleTexture(fourColors(), Vec2(0.5f, 0.5f), 0), Vec4(0.5f, 0.5f, 0.5f, 1));
}

TEST(CoreTexture, nearestDoesNotInterpolate) {
    Texture t = fourColors();
    t.nearest = true;
    expectNear(sampleTexture(t, Vec2(0.49f, 0.2f), 0), Vec4(1, 0, 0, 1));
    expectNear(sampleTexture(t, Vec2(0.51f, 0.2f), 0), Vec4(0, 1, 0, 1));
    t.wrap_u = Wrap::kClamp;
    expectNear(sampleTexture(t, Vec2(1.0f, 0.2f), 0), Vec4(0, 1, 0, 1));
}

TEST(CoreTexture, wrapsAsTheSamplerSays) {
    Texture t = makeTexture(2, 1, {0, 0, 0, 255, 255, 255, 255, 255});
    const auto red = [&](float u) { return sampleTexture(t, Vec2(u, 0.5f), 0).r; };
    EXPECT_NEAR(red(0.0f), 0.5f, 1e-5f);  // repeat: between the last and the first texel
    EXPECT_NEAR(red(-0.75f), 0.0f, 1e-5f);
    EXPECT_NEAR(red(7.75f), 1.0f, 1e-5f);
    t.wrap_u = Wrap::kClamp;
    EXPECT_NEAR(red(0.0f), 0.0f, 1e-5f);
    EXPECT_NEAR(red(5.0f), 1.0f, 1e-5f);
    t.wrap_u = Wrap::kMirror;
    EXPECT_NEAR(red(1.25f), 1.0f, 1e-5f);
    EXPECT_NEAR(red(-0.75f), 1.0f, 1e-5f);
    EXPECT_NEAR(red(2.25f), 0.0f, 1e-5f);
}

TEST(CoreTexture, averagesSrgbAsLight) {
    Texture t = makeTexture(2, 1, {0, 0, 0, 255, 255, 255, 255, 255}, true);
    EXPECT_NEAR(sampleTexture(t, Vec2(0.5f, 0.5f), 0).g, 0.5f, 1e-5f);
    buildMipmaps(t);
    ASSERT_EQ(t.levels.size(), 2u);
    EXPECT_EQ(int(t.levels[1].rgba[0]), 188);  // sRGB of half the light
}

TEST(CoreTexture, transparentTexelsDoNotBleedIntoColour) {
    // A green leaf beside a transparent black texel.
    Texture t = makeTexture(2, 1, {0, 255, 0, 255, 0, 0, 0, 0});
    expectNear(sampleTexture(t, Vec2(0.5f, 0.5f), 0), Vec4(0, 1, 0, 0.5f));
    buildMipmaps(t);
    expectNear(sampleTexture(t, Vec2(0.5f, 0.5f), 2.0f), Vec4(0, 1, 0, 0.5f), 0.003f);
}

TEST(CoreTexture, fullyTransparentAreasKeepTheirColour) {
    Texture t = makeTexture(2, 1, {200, 0, 0, 0, 200, 0, 0, 0});
    buildMipmaps(t);
    expectNear(sampleTexture(t, Vec2(0.5f, 0.5f), 2.0f), Vec4(200 / 255.0f, 0, 0, 0), 1e-5f);
}

TEST(CoreTexture, mipLevelsHalveRoundingUpAndKeepTheMean) {
    const int w = 7, h = 5;
    std::vector<uint8_t> rgba;
    double mean = 0.0;
    for (int i = 0; i < w * h; ++i) {
        const uint8_t v = uint8_t(i * 37 % 256);
        mean += v / 255.0 / (w * h);
        rgba.insert(rgba.end(), {v, v, v, 255});
    }
    Texture t = makeTexture(w, h, rgba);
    buildMipmaps(t);
    ASSERT_EQ(t.levels.size(), 4u);
    EXPECT_EQ(t.levels[1].width, 4);
    EXPECT_EQ(t.levels[1].height, 3);
    EXPECT_EQ(t.levels[2].width, 2);
    EXPECT_EQ(t.levels[2].height, 2);
    EXPECT_EQ(t.levels[3].width, 1);
    EXPECT_NEAR(t.levels[3].rgba[0] / 255.0, mean, 0.6 / 255.0);
}

TEST(CoreTexture, footprintChoosesTheLevelAndBlendsBetween) {
    // A checkerboard of single texels: level 0 has contrast, level 1 has none.
    std::vector<uint8_t> rgba;
    for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
            const uint8_t v = (x + y) % 2 ? 255 : 0;
            rgba.insert(rgba.end(), {v, v, v, 255});
        }
    }
    Texture t = makeTexture(4, 4, rgba);
    buildMipmaps(t);
    const Vec2 dark(0.125f, 0.125f);
    EXPECT_NEAR(sampleTexture(t, dark, 0.25f).r, 0.0f, 1e-5f);
    EXPECT_NEAR(sampleTexture(t, dark, 0.5f).r, 0.5f, 0.01f);
    EXPECT_NEAR(sampleTexture(t, dark, 0.25f * std::sqrt(2.0f)).r, 0.25f, 0.01f);
    EXPECT_NEAR(sampleTexture(t, dark, 1000.0f).r, 0.5f, 0.01f);
}

TEST(CoreTexture, aLongFootprintBlursAlongItOnly) {
    // Stripes of single texels, alternating along u.
    std::vector<uint8_t> rgba;
    for (int i = 0; i < 64 * 64; ++i) {
        const uint8_t v = i % 2 ? 255 : 0;
        rgba.insert(rgba.end(), {v, v, v, 255});
    }
    Texture t = makeTexture(64, 64, rgba);
    buildMipmaps(t);
    const float texel = 1.0f / 64;
    const Vec2 dark(0.5f + 0.5f * texel, 0.5f);
    const Vec2 thin(0.5f * texel, 0.0f);
    for (const float length : {2.0f, 8.0f, float(kMostTextureTaps)}) {
        const Vec2 along(0.0f, length * texel);
        EXPECT_NEAR(sampleTexture(t, dark, thin, along).r, 0.0f, 1e-5f);
        EXPECT_NEAR(sampleTexture(t, dark, along, thin).r, 0.0f, 1e-5f);
        EXPECT_NEAR(sampleTexture(t, dark, Vec2(length * texel, 0), Vec2(0, texel)).r, 0.5f, 0.01f);
    }
    // Longer than the lookups reach, it becomes wider.
    EXPECT_NEAR(sampleTexture(t, dark, thin, Vec2(0.0f, 4 * kMostTextureTaps * texel)).r, 0.5f,
                0.01f);
    // No footprint: the texel itself. Turned by 45 degrees it meets as many bright as dark texels.
    EXPECT_NEAR(sampleTexture(t, dark, Vec2(0), Vec2(0)).r, 0.0f, 1e-5f);
    EXPECT_NEAR(sampleTexture(t, dark, Vec2(6 * texel), Vec2(texel, -texel) * 0.5f).r, 0.5f, 0.05f);
}

TEST(CoreTexture, survivesCoordinatesThatAreNotFinite) {
    const Texture t = fourColors();
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (float u : {nan, kInfinity, -kInfinity, 1e30f, -1e30f}) {
        const Vec4 v = sampleTexture(t, Vec2(u, -u), nan);
        EXPECT_TRUE(v.r >= 0.0f && v.r <= 1.0f);
    }
    expectNear(sampleTexture(Texture(), Vec2(0.5f), 0), Vec4(1));
}

TEST(CoreTexture, bytesCountAllLevels) {
    Texture t = fourColors();
    buildMipmaps(t);
    EXPECT_GE(t.bytes(), 2u * 2 * 4 + 4);
}

}  // namespace
}  // namespace stipple
