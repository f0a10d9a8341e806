// SPDX-License-Identifier: Apache-2.0
// Closed-form cases for every reconstruction: planes, straight edges, colours that must not spread.
#include "point_cloud_source.h"

#include <gtest/gtest.h>
#include <reconstruct/depth_pass.h>
#include <reconstruct/subpixel_shader.h>

namespace stipple {
namespace {

constexpr Reconstruct kAll[] = {Reconstruct::kPerPixel, Reconstruct::kSplat, Reconstruct::kGaussian,
                                Reconstruct::kPullPush, Reconstruct::kEwa,   Reconstruct::kBins};

std::string nameOf(const TestFrame& frame) {
    return settingValue(frame.settings, "reconstruct") + " subpixels " +
           std::to_string(frame.settings.subpixels) + " samples " +
           std::to_string(frame.settings.samples);
}

TEST(ReconstructMethods, aPlaneIsClosedAndKeepsItsColour) {
    for (const Reconstruct method : kAll) {
        for (const int subpixels : {1, 4}) {
            for (const float slope : {0.0f, 1.5f}) {
                TestFrame frame;
                frame.settings.reconstruct = method;
                frame.settings.subpixels = subpixels;
                frame.settings.samples = 4;
                std::vector<TestPoint> points;
                frame.addPlane(points, -4, 64, -4, 44, 100.0f, slope, 0, 1);
                const Image image = frame.draw(points);
                const int coverage = image.channelIndex("coverage"),
                          depth = image.channelIndex("depth");
                for (int y = 0; y < image.height; ++y) {
                    for (int x = 0; x < image.width; ++x) {
                        const float* p = image.pixel(x, y);
                        ASSERT_NEAR(p[coverage], 1.0f, 1e-5f)
                            << nameOf(frame) << " " << x << "," << y;
                        ASSERT_NEAR(p[0], 1.0f, 1e-5f) << nameOf(frame) << " " << x << "," << y;
                        ASSERT_EQ(p[1], 0.0f);
                        // Of a point no more than a pixel away.
                        ASSERT_NEAR(p[depth], 100.0f + slope * (float(x) + 0.5f), slope + 1e-3f)
                            << nameOf(frame);
                    }
                }
            }
        }
    }
}

// Sum over the columns of the mean over the rows.
double coveredWidth(const Image& image, int channel) {
    double sum = 0.0;
    for (int y = 4; y < image.height - 4; ++y) {
        for (int x = 0; x < image.width; ++x) sum += image.pixel(x, y)[channel];
    }
    return sum / double(image.height - 8);
}

TEST(ReconstructMethods, aStraightEdgeIsWhereThePointsEnd) {
    // A subpixel, a quarter of a pixel, shows what lies anywhere in it: half a subpixel. Per-pixel
    // covers 2 x 2 subpixels on large surfaces, half a subpixel more. The gaussian's weights on
    // neighbouring pixels do not sum up to 1: 2 exp(-2 pi^2 sigma^2) / 2 pi = 0.06 pixels.
    // A cell of pull-push, here a pixel, is a corner of the mesh if three eighths are filled.
    for (const Reconstruct method : kAll) {
        const float most = method == Reconstruct::kPerPixel   ? 0.26f
                           : method == Reconstruct::kGaussian ? 0.19f
                           : method == Reconstruct::kPullPush ? 0.125f + 0.125f
                                                              : 0.13f;
        for (const float edge : {30.0f, 30.4f, 30.75f}) {
            // Splats of three subpixels and of about four.
            for (const double splat_size : {0.75, 1.0}) {
                if (splat_size != 0.75 && method != Reconstruct::kSplat) continue;
                TestFrame frame;
                frame.settings.reconstruct = method;
                frame.settings.samples = 2;
                frame.settings.splat_size = splat_size;
                std::vector<TestPoint> points;
                frame.addPlane(points, -4, edge, -4, 44, 100.0f, 0.0f, 0, 3);
                const Image image = frame.draw(points);
                EXPECT_NEAR(coveredWidth(image, image.channelIndex("coverage")), edge, most)
                    << nameOf(frame) << " edge " << edge << " splats of " << splat_size;
            }
        }
    }
}

TEST(ReconstructMethods, theForegroundDoesNotBleedOverMoreThanTwoPixels) {
    for (const Reconstruct method : kAll) {
        for (const int subpixels : {1, 2, 4}) {
            for (const float slope : {0.0f, 0.5f}) {
                TestFrame frame;
                frame.settings.reconstruct = method;
                frame.settings.subpixels = subpixels;
                frame.settings.samples = 1;
                std::vector<TestPoint> points;
                // Slanted, so that the edge meets pixels and cells at all places.
                frame.addPlane(points, -4, 64, -4, 44, 300.0f, slope, 1, 5);
                std::vector<TestPoint> front;
                frame.addPlane(front, -4, 64, -4, 44, 100.0f, slope, 0, 7);
                const auto edgeAt = [](float y) { return 25.0f + 0.31f * y; };
                for (const TestPoint& p : front) {
                    if (p.position.x + 30.0f < edgeAt(p.position.y + 20.0f)) points.push_back(p);
                }
                const Image image = frame.draw(points);
                for (int y = 0; y < image.height; ++y) {
                    for (int x = 0; x < image.width; ++x) {
                        // To the pixel's nearer side.
                        const float beyond = float(x) - edgeAt(float(y) + 0.5f) - 0.5f * 0.31f;
                        const float* p = image.pixel(x, y);
                        if (beyond > 2.0f) {
                            ASSERT_LT(p[0], 0.01f) << nameOf(frame) << " " << x << "," << y;
                        }
                    }
                }
            }
        }
    }
}

TEST(ReconstructMethods, surfacesCloseAtHalfAPointASubpixel) {
    TestFrame frame;
    frame.settings.reconstruct = Reconstruct::kPullPush;
    for (const int subpixels : {1, 2, 4}) {
        for (const double samples : {0.5, 1.0, 3.0}) {
            frame.settings.subpixels = subpixels;
            frame.settings.samples = samples;
            std::vector<TestPoint> points;
            // Independent points: the worst there is. A green surface behind shows through holes.
            frame.addPlane(points, -4, 64, -4, 44, 300.0f, 0.0f, 1, 11, true);
            frame.addPlane(points, -4, 64, -4, 44, 100.0f, 0.3f, 0, 13, true);
            const Image image = frame.draw(points);
            int through = 0;
            for (int y = 0; y < image.height; ++y) {
                for (int x = 0; x < image.width; ++x) through += image.pixel(x, y)[0] < 0.5f;
            }
            EXPECT_EQ(through, 0) << nameOf(frame);
        }
    }
}

// Pixels of a red surface through which a green one behind it is seen.
int pixelsSeenThrough(const TestFrame& frame) {
    std::vector<TestPoint> points;
    frame.addPlane(points, -4, 64, -4, 44, 300.0f, 0.0f, 1, 11, true);
    frame.addPlane(points, -4, 64, -4, 44, 100.0f, 0.3f, 0, 13, true);
    const Image image = frame.draw(points);
    int through = 0;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) through += image.pixel(x, y)[1] > 0.1f;
    }
    return through;
}

TEST(ReconstructMethods, fillingClosesHolesOfAPixel) {
    TestFrame frame;
    frame.settings.subpixels = 2;
    for (const Reconstruct method : {Reconstruct::kPerPixel, Reconstruct::kEwa}) {
        frame.settings.reconstruct = method;
        frame.settings.samples = method == Reconstruct::kPerPixel ? 1.5 : 1.0;
        frame.settings.fill = false;
        const int open = pixelsSeenThrough(frame);
        EXPECT_GE(open, 8) << nameOf(frame);
        frame.settings.fill = true;
        EXPECT_LE(pixelsSeenThrough(frame) * 4, open) << nameOf(frame);
    }
}

TEST(ReconstructMethods, noHolesWhereTwoLevelsMeet) {
    TestFrame frame;
    frame.settings.reconstruct = Reconstruct::kPullPush;
    frame.settings.samples = 0.5;  // level 3
    frame.settings.subpixels = 2;
    std::vector<TestPoint> points;
    frame.addPlane(points, -4, 64, -4, 44, 300.0f, 0.0f, 1, 17, true);
    const size_t behind = points.size();
    frame.addPlane(points, -4, 64, -4, 44, 100.0f, 0.0f, 0, 19, true);
    // Half of the surface is drawn on level 2, with twice as many points.
    std::vector<TestPoint> more;
    frame.addPlane(more, -4, 64, -4, 44, 100.0f, 0.0f, 0, 23, true);
    points.insert(points.end(), more.begin(), more.end());
    std::vector<TestPoint> kept(points.begin(), points.begin() + ptrdiff_t(behind));
    for (size_t i = behind; i < points.size(); ++i) {
        TestPoint p = points[i];
        const bool is_fine = p.position.x + 0.4f * p.position.y < 0.0f;
        if (is_fine) p.width = 12.0f;
        if (is_fine || i < points.size() - more.size()) kept.push_back(p);
    }
    const Image image = frame.draw(kept);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x)
            ASSERT_LT(image.pixel(x, y)[1], 0.02f) << x << "," << y;
    }
}

TEST(ReconstructMethods, sameBitsForAnyTilesAndThreads) {
    for (const Reconstruct method : kAll) {
        TestFrame frame;
        frame.settings.reconstruct = method;
        frame.settings.subpixels = 2;
        std::vector<TestPoint> points;
        frame.addPlane(points, -4, 64, -4, 44, 300.0f, 0.0f, 1, 29);
        frame.addPlane(points, 10, 37, 8, 31, 100.0f, 0.4f, 0, 31);
        for (size_t i = 0; i < points.size(); i += 3) points[i].width = 0.5f + float(i % 11);
        frame.settings.tile_size = 4096;
        const Image whole = frame.draw(points, 1);
        for (const int tile : {16, 22, 48}) {
            frame.settings.tile_size = tile;
            EXPECT_EQ(whole.data, frame.draw(points, 3).data) << nameOf(frame) << " tile " << tile;
        }
    }
}

TEST(ReconstructMethods, splatsOfTheWorldShrinkWithDistance) {
    TestFrame frame;
    frame.camera.orthographic = false;
    frame.settings.splat_world = 1.0;
    Picture picture(frame.view(), frame.lighting, {}, false);
    ReconstructionContext context;
    context.view = frame.view();
    context.settings = frame.settings;
    context.picture = &picture;
    const DepthPass pass(context, 33);
    const float focal = float(context.view.focal);
    EXPECT_EQ(pass.sideAt(focal / 8.5f), 9);
    EXPECT_EQ(pass.sideAt(focal / 3.0f), 3);
    EXPECT_EQ(pass.sideAt(1e6f), 1);
    EXPECT_EQ(pass.sideAt(1e-3f), 33);
}

// 64 points on one place, turned to the eye.
PointBlock blockAt(float x, float y, float z, float area) {
    PointBlock block;
    block.count = kBlockPoints;
    for (int i = 0; i < kBlockPoints + kBlockPadding; ++i) {
        block.x[i] = x, block.y[i] = y, block.z[i] = z;
        block.number[i] = uint32_t(i);
        block.keep[i] = 1;
        block.width[i] = patchWidthCode(1e4f, kFirstSubpixelExponent);
        block.normal_x[i] = block.normal_y[i] = 0.0f, block.normal_z[i] = -1.0f;
        block.area[i] = area;
    }
    return block;
}

TEST(ReconstructMethods, blocksThatShowNothingAreGivenBack) {
    class NoLookup : public SampleLookup {
        void lookUp(uint32_t, float, float, SurfaceSample&) const override {}
    } no_lookup;
    for (const Reconstruct method : kAll) {
        TestFrame frame;
        frame.settings.reconstruct = method;
        frame.settings.culling = false;
        Picture picture(frame.view(), frame.lighting, {}, false);
        ReconstructionContext context;
        context.view = frame.view();
        context.settings = frame.settings;
        context.lighting = &frame.lighting;
        context.materials = &frame.materials;
        context.picture = &picture;
        const auto reconstruction = makeReconstruction(context);
        const SubpixelRect all{0, 0, context.view.subWidth(), context.view.subHeight()};
        reconstruction->beginTile(all, all);
        reconstruction->beginPass(0, no_lookup);
        const float area = 1.0f / 16.0f;
        EXPECT_TRUE(reconstruction->take(blockAt(0.6f, 0.6f, 100.0f, area))) << nameOf(frame);
        EXPECT_FALSE(reconstruction->take(blockAt(0.6f, 0.6f, 200.0f, area))) << nameOf(frame);
        EXPECT_TRUE(reconstruction->take(blockAt(9.6f, 0.6f, 200.0f, area))) << nameOf(frame);
        if (method != Reconstruct::kEwa) continue;
        // The subpixel it hits shows something nearer, but its disc reaches beyond.
        EXPECT_TRUE(reconstruction->take(blockAt(4.6f, 0.6f, 50.0f, 0.01f * area)));
        EXPECT_TRUE(reconstruction->take(blockAt(4.6f, 0.6f, 90.0f, area)));
    }
}

// A block whose points all cover the same takes a way of its own.
TEST(ReconstructMethods, pointsThatCoverAlikeAreDrawnLikeOthers) {
    for (const bool orthographic : {true, false}) {
        for (const double samples : {0.5, 1.0, 4.0}) {
            TestFrame frame;
            frame.camera.orthographic = orthographic;
            frame.settings.samples = samples;
            Picture picture(frame.view(), frame.lighting, {}, false);
            ReconstructionContext context;
            context.view = frame.view();
            context.settings = frame.settings;
            context.picture = &picture;
            const SubpixelRect all{0, 0, context.view.subWidth(), context.view.subHeight()};
            Rng rng{5};
            for (const int count : {1, 17, 46, kBlockPoints - 1}) {
                PointBlock block = blockAt(0.0f, 0.0f, 100.0f, 1.0f);
                block.count = count;
                for (int i = 0; i < count; ++i) {
                    block.x[i] = float(rng.uniform(-35, 35)),
                    block.y[i] = float(rng.uniform(-25, 25));
                    block.z[i] = orthographic ? 50.0f : float(rng.uniform(20, 60));
                    block.keep[i] = uint8_t(i % 5 != 0);
                    block.width[i] = kNoPatch;
                }
                // With one more that lies behind the eye and is not kept.
                PointBlock mixed = block;
                mixed.count = count + 1;
                mixed.x[count] = mixed.y[count] = 0.0f, mixed.z[count] = -1.0f;
                mixed.keep[count] = 0;
                mixed.width[count] = kSurfaceCode;
                DepthPass pass(context, 0), other(context, 0);
                DepthTile tile, other_tile;
                tile.reset(all, nullptr, 0), other_tile.reset(all, nullptr, 0);
                pass.begin(all), other.begin(all);
                EXPECT_TRUE(pass.take(block, tile) == other.take(mixed, other_tile));
                EXPECT_EQ(tile.keys(), other_tile.keys());
                EXPECT_EQ(pass.counters().points_kept, other.counters().points_kept);
            }
        }
    }
}

TEST(ReconstructMethods, onePointAtTwoDepthsIsSeenAtBoth) {
    // Looked up and shaded where it is seen, whichever place came before: haze tells the depth.
    class Lookup : public SampleLookup {
    public:
        mutable int count = 0;
        void lookUp(uint32_t, float, float, SurfaceSample& sample) const override {
            sample.albedo = Vec3(0.5f);
            ++count;
        }
    } lookup;
    TestFrame frame;
    frame.lighting.sky.horizon = Vec3(1.0f);
    frame.lighting.sky.haze_distance = 100.0f;
    ReconstructionContext context;
    context.view = frame.view();
    context.materials = &frame.materials;
    context.lighting = &frame.lighting;
    SubpixelShader shader(context), fresh(context);
    shader.show(lookup, DepthTile::pack(50.0f, 7), 8, 8);
    shader.show(lookup, DepthTile::pack(200.0f, 7), 9, 8);
    EXPECT_EQ(lookup.count, 2);
    fresh.show(lookup, DepthTile::pack(200.0f, 7), 9, 8);
    EXPECT_EQ(shader.sample().depth, 200.0f);
    EXPECT_EQ(shader.sample().position_camera, fresh.sample().position_camera);
    EXPECT_EQ(shader.radiance(), fresh.radiance());
}

TEST(ReconstructMethods, drawnSettingsKeepThePoints) {
    RenderSettings settings;
    settings.reconstruct = Reconstruct::kGaussian;
    settings.subpixels = 1;
    settings.samples = 4;
    const RenderSettings drawn = drawnSettings(settings);
    EXPECT_EQ(drawn.subpixels, 2);
    EXPECT_EQ(drawn.samples, 1.0);
    settings.subpixels = 4;
    EXPECT_EQ(drawnSettings(settings).subpixels, 4);
    EXPECT_EQ(drawnSettings(settings).samples, 4.0);
    settings.subpixels = 1;
    settings.reconstruct = Reconstruct::kPerPixel;
    EXPECT_EQ(drawnSettings(settings).subpixels, 1);
    settings.reconstruct = Reconstruct::kEwa;
    settings.method = Method::kRaycast;
    EXPECT_EQ(drawnSettings(settings).samples, 4.0);
}

}  // namespace
}  // namespace stipple
