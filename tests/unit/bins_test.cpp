// SPDX-License-Identifier: Apache-2.0
// Layers of known alpha in front of each other, put together as they should be.
#include "point_cloud_source.h"

#include <gtest/gtest.h>
#include <reconstruct/layer_bins.h>

#include <algorithm>

namespace stipple {
namespace {

TestFrame blendedFrame() {
    TestFrame frame;
    for (Material& m : frame.materials) m.alpha_mode = AlphaMode::kBlend;
    frame.settings.reconstruct = Reconstruct::kBins;
    frame.settings.subpixels = 2;
    frame.settings.samples = 3;
    return frame;
}

// A plane of one colour that is seen through.
void addLayer(const TestFrame& frame, float x0, float x1, float depth, float slope,
              uint32_t material, float alpha, std::vector<TestPoint>& points) {
    const size_t first = points.size();
    frame.addPlane(points, x0, x1, -4, 44, depth, slope, material, uint64_t(depth) + material);
    for (size_t i = first; i < points.size(); ++i) points[i].alpha = alpha;
}

TEST(Bins, layersGoInFrontOfEachOther) {
    const TestFrame frame = blendedFrame();
    for (const float slope : {0.0f, 0.8f, 3.0f}) {
        std::vector<TestPoint> points;
        // Not in the order of their depths.
        addLayer(frame, -4, 64, 500.0f, slope, 1, 0.6f, points);
        frame.addPlane(points, -4, 64, -4, 44, 900.0f, 0.0f, 2, 3);
        addLayer(frame, -4, 64, 300.0f, slope, 0, 0.3f, points);
        const Image image = frame.draw(points);
        const int coverage = image.channelIndex("coverage");
        for (int y = 2; y < image.height - 2; ++y) {
            for (int x = 2; x < image.width - 2; ++x) {
                const float* p = image.pixel(x, y);
                ASSERT_NEAR(p[0], 0.3f, 1e-4f) << slope << " at " << x << "," << y;
                ASSERT_NEAR(p[1], 0.7f * 0.6f, 1e-4f) << slope << " at " << x << "," << y;
                ASSERT_NEAR(p[2], 0.7f * 0.4f, 1e-4f) << slope << " at " << x << "," << y;
                ASSERT_NEAR(p[coverage], 1.0f, 1e-4f);
            }
        }
    }
}

TEST(Bins, coverageIsAlphaWithinAndEndsAtTheEdge) {
    TestFrame frame = blendedFrame();
    for (const double samples : {0.25, 1.0, 4.0}) {
        frame.settings.samples = samples;
        for (const float edge : {30.0f, 30.4f, 30.75f}) {
            std::vector<TestPoint> points;
            addLayer(frame, -4, edge, 100.0f, 0.0f, 0, 0.5f, points);
            const Image image = frame.draw(points);
            const int coverage = image.channelIndex("coverage");
            double width = 0.0;
            for (int y = 4; y < image.height - 4; ++y) {
                for (int x = 0; x < image.width; ++x) width += image.pixel(x, y)[coverage];
                for (int x = 2; x < 26; ++x) {
                    ASSERT_NEAR(image.pixel(x, y)[coverage], 0.5f, 0.01f)
                        << samples << " at " << x << "," << y;
                }
            }
            // Subpixels are covered as a whole; few points leave an edge ragged.
            EXPECT_NEAR(width / (0.5 * (image.height - 8)), edge, samples < 1.0 ? 0.75 : 0.26)
                << samples << " points, edge at " << edge;
        }
    }
}

TEST(Bins, moreLayersThanBinsKeepTheirOpacity) {
    const TestFrame frame = blendedFrame();
    constexpr int kLayers = 2 * kMostBins;
    std::vector<TestPoint> points;
    frame.addPlane(points, -4, 64, -4, 44, 5000.0f, 0.0f, 2, 3);
    for (int i = 0; i < kLayers; ++i)
        addLayer(frame, -4, 64, 100.0f * float(i + 1), 0.0f, uint32_t(i) % 2, 0.1f, points);
    const Image image = frame.draw(points);
    double red = 0.0, green = 0.0, left = 1.0;
    for (int i = 0; i < kLayers; ++i, left *= 0.9) (i % 2 ? green : red) += 0.1 * left;
    for (int y = 2; y < image.height - 2; ++y) {
        for (int x = 2; x < image.width - 2; ++x) {
            const float* p = image.pixel(x, y);
            ASSERT_NEAR(p[0], red, 0.02);
            ASSERT_NEAR(p[1], green, 0.02);
            ASSERT_NEAR(p[2], left, 0.02);
        }
    }
}

TEST(Bins, theOrderOfPointsDoesNotMatter) {
    const TestFrame frame = blendedFrame();
    std::vector<TestPoint> points;
    frame.addPlane(points, -4, 40, -4, 44, 900.0f, 0.0f, 2, 3);
    for (int i = 0; i < 12; ++i) {
        addLayer(frame, float(3 * i), 64, 100.0f + 30.0f * float(i), 0.3f * float(i % 5),
                 uint32_t(i) % 3, 0.2f + 0.05f * float(i), points);
    }
    const Image image = frame.draw(points, 1);
    Rng rng{7};
    for (int round = 0; round < 3; ++round) {
        for (size_t i = points.size(); i-- > 1;)
            std::swap(points[i], points[size_t(rng.uniform() * double(i + 1))]);
        ASSERT_EQ(frame.draw(points, 1 + round).data, image.data);
    }
}

}  // namespace
}  // namespace stipple
