// SPDX-License-Identifier: Apache-2.0
// Tone curves: black stays black, brighter is never darker, and all fits the display.
#include <core/tone.h>

#include <gtest/gtest.h>

namespace stipple {
namespace {

TEST(CoreTone, curvesRiseFromBlackToWhite) {
    for (const Tone tone : {Tone::kFilmic, Tone::kAces, Tone::kAgx}) {
        EXPECT_LT(toneMapped(tone, Vec3(0.0f)).x, 0.005f);
        float before = -1.0f;
        for (float stops = -10.0f; stops < 6.0f; stops += 0.25f) {
            const Vec3 c = toneMapped(tone, Vec3(std::exp2(stops)));
            EXPECT_NEAR(c.x, c.y, 2e-3f) << "grey stays grey";
            EXPECT_NEAR(c.x, c.z, 2e-3f);
            EXPECT_GE(c.x, before);
            EXPECT_LE(c.x, 1.0f);
            before = c.x;
        }
        EXPECT_GT(before, 0.9f);
        // What would have been cut off differs still.
        EXPECT_GT(toneMapped(tone, Vec3(4.0f)).x, toneMapped(tone, Vec3(1.0f)).x + 0.05f);
    }
    EXPECT_EQ(toneMapped(Tone::kNone, Vec3(3.0f)), Vec3(3.0f));
}

// Of the published curves: Narkowicz maps 1 to 0.8038, AgX middle grey to about 0.18.
TEST(CoreTone, publishedValues) {
    EXPECT_NEAR(toneMapped(Tone::kAces, Vec3(1.0f)).x, 2.54f / 3.16f, 1e-4f);
    EXPECT_NEAR(toneMapped(Tone::kFilmic, Vec3(5.6f)).x, 1.0f, 1e-4f) << "white";
    EXPECT_NEAR(toneMapped(Tone::kAgx, Vec3(0.18f)).x, 0.18f, 0.04f);
}

TEST(CoreTone, premultipliedColoursAreMappedAsTheyAre) {
    Image image(1, 1, {"R", "G", "B", "A"});
    float* p = image.pixel(0, 0);
    p[0] = p[1] = p[2] = 0.5f;
    p[3] = 0.25f;
    applyTone(Tone::kAces, image);
    EXPECT_NEAR(p[0], 0.25f * toneMapped(Tone::kAces, Vec3(2.0f)).x, 1e-6f);
    EXPECT_EQ(p[3], 0.25f);
}

}  // namespace
}  // namespace stipple
