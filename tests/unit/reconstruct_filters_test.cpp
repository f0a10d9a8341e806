// SPDX-License-Identifier: Apache-2.0
// The parts of reconstructions by themselves: kernels, pixel filters, pull-push, levels, erosion.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <reconstruct/ellipse.h>
#include <reconstruct/erode.h>
#include <reconstruct/level_depths.h>
#include <reconstruct/pixel_filter.h>
#include <reconstruct/pull_push_fill.h>

namespace stipple {
namespace {

TEST(ReconstructFilters, aSplatIntegratesToOne) {
    Rng rng{3};
    for (int k = 0; k < 20; ++k) {
        const float a = float(rng.uniform(0.8, 6.0)), b = float(rng.uniform(0.8, 6.0));
        const float t = float(rng.uniform(0.0, 3.2)), c = std::cos(t), s = std::sin(t);
        const Variance v = {a * c * c + b * s * s, (a - b) * c * s, a * s * s + b * c * c};
        const Vec2 center(float(rng.uniform(30, 34)), float(rng.uniform(30, 34)));
        double sum = 0.0;
        visitEllipse(center, v, kKernelEnd, 0, 0, 64, 64,
                     [&](int, int, const Vec2&, float r) { sum += kernel(r); });
        EXPECT_NEAR(sum / double(kernelIntegral(v)), 1.0, 0.01);
    }
}

TEST(ReconstructFilters, aDiscsEllipseIsItsProjection) {
    Camera camera;
    const View view = makeView(camera, 200, 200, 2);
    const Vec3 p(1.2f, -0.7f, 6.0f), n = glm::normalize(Vec3(0.5f, 0.3f, -0.8f));
    const Ellipse e = makeEllipse(view, p, n);
    const Vec3 s = glm::normalize(glm::cross(n, Vec3(0, 1, 0))), t = glm::cross(n, s);
    const float radius = 0.02f;
    const Variance v = e.unit.times(radius * radius);
    for (int k = 0; k < 16; ++k) {
        const float angle = 0.39f * float(k);
        const Vec3 rim = p + (s * std::cos(angle) + t * std::sin(angle)) * radius;
        const Vec2 d = view.project(rim) - e.center;
        const float det = v.determinant();
        const float r = (v.yy * d.x * d.x - 2.0f * v.xy * d.x * d.y + v.xx * d.y * d.y) / det;
        EXPECT_NEAR(r, 1.0f, 0.02f);
        EXPECT_NEAR(planeDepth(view, e, d), rim.z, 1e-4f);
    }
    // The projected area is the area times the projection factor.
    const float f = float(view.focal);
    const float factor = f * f * std::abs(glm::dot(n, p)) / (p.z * p.z * p.z);
    EXPECT_NEAR(std::sqrt(e.unit.determinant()) / factor, 1.0f, 1e-4f);
}

TEST(ReconstructFilters, pixelFiltersKeepConstantsAndVariance) {
    for (const int s : {1, 3, 4}) {
        for (const float sigma : {0.0f, 0.3f, 1.2f, 5.0f}) {
            PixelFilter filter(s, sigma);
            ShadedTile tile;
            tile.reset({0, 0, 12 * s, 9 * s});
            for (ShadedSubpixel& p : tile.data) p = {Vec3(0.5f, 0.25f, 2.0f), 1.0f, 7.0f};
            int pixels = 0;
            filter.apply(tile, tile.rect, [&](int, int, PixelSums& sums) {
                EXPECT_NEAR(sums.covered / sums.samples, 1.0f, 1e-5f);
                EXPECT_NEAR(sums.radiance.z / sums.samples, 2.0f, 1e-5f);
                EXPECT_NEAR(sums.depth / sums.covered, 7.0f, 1e-4f);
                ++pixels;
            });
            EXPECT_EQ(pixels, 12 * 9);
        }
    }
    const PixelFilter wide(4, 5.0f);
    double sum = 0.0, square = 0.0;
    for (size_t i = 0; i < wide.weights().size(); ++i) {
        const double d = double(wide.first()) + double(i) - 1.5;
        sum += wide.weights()[i];
        square += wide.weights()[i] * d * d;
    }
    EXPECT_NEAR(std::sqrt(square / sum), 5.0, 0.5);  // cut off at 2.5 sigma
}

PullPushRules rulesOf(int levels) {
    PullPushRules rules;
    rules.levels = levels;
    rules.slope = 0.01f;
    rules.coverage = [](int, int, float) { return 0.0f; };
    return rules;
}

TEST(ReconstructFilters, pullPushOfAFullImageIsTheIdentity) {
    WeightedImage image;
    image.reset(37, 22, 3);
    Rng rng{5};
    for (float& v : image.values) v = float(rng.uniform());
    std::fill(image.weights.begin(), image.weights.end(), 1.0f);
    std::fill(image.depths.begin(), image.depths.end(), 2.0f);
    const std::vector<float> before = image.values;
    pullPush(image, rulesOf(4));
    EXPECT_EQ(image.values, before);
}

TEST(ReconstructFilters, pullPushFillsHolesAndKeepsConstants) {
    WeightedImage image;
    image.reset(40, 40, 2);
    Rng rng{7};
    for (size_t i = 0; i < image.weights.size(); ++i) {
        const double u = rng.uniform();
        image.weights[i] = u < 0.4 ? 0.0f : float(rng.uniform());
        image.depths[i] = 2.0f;
        image.values[2 * i] = image.weights[i] > 0.0f ? 3.0f : -100.0f;
        image.values[2 * i + 1] = image.weights[i] > 0.0f ? 0.5f : 1e9f;
    }
    pullPush(image, rulesOf(5));
    for (size_t i = 0; i < image.weights.size(); ++i) {
        EXPECT_NEAR(image.values[2 * i], 3.0f, 1e-4f);
        EXPECT_NEAR(image.values[2 * i + 1], 0.5f, 1e-4f);
    }
    // A single pixel reaches as far as the levels do, no farther.
    image.reset(64, 64, 1);
    image.values[0] = 1.0f;
    image.weights[0] = 1.0f;
    image.depths[0] = 2.0f;
    pullPush(image, rulesOf(3));
    EXPECT_NEAR(image.values[7 * 64 + 7], 1.0f, 1e-5f);
    EXPECT_EQ(image.values[40 * 64 + 40], 0.0f);
    pullPush(image, rulesOf(0));
    EXPECT_EQ(image.values[40 * 64 + 40], 0.0f);
}

// A near surface on the left, a far one on the right, sky above both; holes everywhere.
TEST(ReconstructFilters, pullPushFillsFromTheSurfaceThatIsThere) {
    constexpr int kEdge = 21, kSky = 13;
    for (const bool covers : {false, true}) {
        PullPushRules rules = rulesOf(4);
        rules.coverage = [&](int x, int, float depth) {
            return covers || (x < kEdge && depth > 4.0f) ? 1.0f : 0.0f;
        };
        WeightedImage image;
        image.reset(48, 48, 2);
        Rng rng{11};
        size_t i = 0;
        for (int y = 0; y < 48; ++y) {
            for (int x = 0; x < 48; ++x, ++i) {
                if (y >= kSky && rng.uniform() < 0.5) continue;
                image.weights[i] = 1.0f;
                if (y < kSky) continue;
                image.depths[i] = x < kEdge ? 3.0f : 9.0f;
                image.values[2 * i + (x < kEdge ? 0 : 1)] = 1.0f;
            }
        }
        pullPush(image, rules);
        double mixed = 0.0;
        for (int y = 0; y < 48; ++y) {
            for (int x = 0; x < 48; ++x) {
                const float* value = &image.values[2 * size_t(y * 48 + x)];
                EXPECT_NEAR(value[0] + value[1], y < kSky ? 0.0f : 1.0f, 1e-5f);
                if (!covers && x >= kEdge) {
                    EXPECT_EQ(value[0], 0.0f) << x << "," << y;
                }
                mixed += double(value[0] * value[1]);
            }
        }
        // Where it is said to be covered, the mean of both goes over the edge.
        if (covers) {
            EXPECT_GT(mixed, 1.0);
        }
    }
}

TEST(ReconstructFilters, levelsFollowTheDensity) {
    EXPECT_EQ(levelOfDensity(9.0), 0);
    EXPECT_EQ(levelOfDensity(1e6), 0);
    EXPECT_EQ(levelOfDensity(2.25), 1);
    EXPECT_EQ(levelOfDensity(1.0), 2);
    EXPECT_EQ(levelOfDensity(0.5), 3);
    EXPECT_EQ(levelOfDensity(1e-9), kMostLevels);
    const View view = makeView(Camera{}, 64, 64, 1);
    const LevelDepths levels(view, 3, PullPushCoverage::kBilinear, true);
    const auto level = [&](float width) {
        return levels.levelOf(patchWidthCode(width, kFirstSubpixelExponent));
    };
    EXPECT_EQ(levels.levelOf(kNoPatch), 0);
    EXPECT_EQ(level(0.01f), 0);
    EXPECT_EQ(level(3.0f), 0);
    EXPECT_EQ(level(5.0f), 1);
    EXPECT_EQ(level(9.0f), 2);
    EXPECT_EQ(level(1e5f), 3);
}

TEST(ReconstructFilters, oneCellCoversAsTheBilinearMeshSays) {
    Camera camera;
    camera.orthographic = true;
    const View view = makeView(camera, 64, 64, 1);
    DepthTile hits;
    hits.reset({0, 0, 64, 64}, nullptr, 0);
    LevelDepths levels(view, 2, PullPushCoverage::kBilinear, true);
    levels.reset({0, 0, 64, 64});
    // All of cell (4, 4) is hit, and nothing else.
    for (int y = 16; y < 20; ++y) {
        for (int x = 16; x < 20; ++x) {
            levels.add(2, x, y, 10.0f);
            hits.row(y)[x] = DepthTile::pack(10.0f, 1);
        }
    }
    levels.finish(hits, 20.0);
    // The centre of the subpixel at (17, 17) is an eighth of a cell from the vertex at (18, 18).
    // The mesh fades over half a cell, two subpixels.
    EXPECT_EQ(levels.coverage(17, 17, 1e6f), 1.0f);
    EXPECT_NEAR(levels.coverage(19, 16, 1e6f), 0.5f + 2.0f * (0.625f * 0.625f - 0.5f), 1e-5f);
    EXPECT_NEAR(levels.coverage(20, 17, 1e6f), 0.5f + 2.0f * (0.375f * 0.875f - 0.5f), 1e-5f);
    EXPECT_EQ(levels.coverage(23, 17, 1e6f), 0.0f);
    EXPECT_EQ(levels.coverage(17, 17, 10.0f), 0.0f);
    LevelDepths squares(view, 2, PullPushCoverage::kSquares, false);
    squares.reset({0, 0, 64, 64});
    squares.add(2, 16, 16, 10.0f);
    squares.finish(hits, 20.0);
    EXPECT_EQ(squares.coverage(19, 19, 10.1f), 1.0f);
    EXPECT_EQ(squares.coverage(20, 19, 10.1f), 0.0f);
    EXPECT_EQ(squares.coverage(19, 19, 10.0f), 0.0f);
}

TEST(ReconstructFilters, erosionTakesBackWhatSplatsAdd) {
    DepthTile tile;
    const auto at = [](int x, int y) { return x >= 10 && x < 30 && y >= 12 && y < 25; };
    const int reach = 2;
    tile.reset({0, 0, 48, 40}, nullptr, 0);
    // Splats of 5 x 5 at every second place.
    for (int y = 0; y < 40; ++y) {
        for (int x = 0; x < 48; ++x) {
            if (!at(x, y) || (x % 2 != y % 2 && x != 10 && x != 29 && y != 12 && y != 24)) continue;
            for (int v = y - reach; v <= y + reach; ++v) {
                for (int u = x - reach; u <= x + reach; ++u)
                    tile.row(v)[u] = std::min(tile.row(v)[u], DepthTile::pack(5.0f, 7));
            }
        }
    }
    tile.row(36)[40] = DepthTile::pack(3.0f, kTriangleBit | 1);
    std::vector<uint64_t> eroded;
    erodeSplats(
        tile, [&](float) { return reach; }, eroded);
    tile.keys().swap(eroded);
    for (int y = reach; y < 40 - reach; ++y) {
        for (int x = reach; x < 48 - reach; ++x) {
            const bool is_triangle = x == 40 && y == 36;
            EXPECT_EQ(DepthTile::depthOf(tile.row(y)[x]) < kInfinity, at(x, y) || is_triangle)
                << x << "," << y;
        }
    }
}

TEST(ReconstructFilters, farthestWithinIsTheLargestOfASquare) {
    DepthTile tile;
    tile.reset({5, 7, 28, 20}, nullptr, 0);
    Rng rng{3};
    for (int y = 7; y < 20; ++y) {
        for (int x = 5; x < 28; ++x)
            tile.row(y)[x] = DepthTile::pack(float(rng.uniform()), uint32_t(x));
    }
    for (const int reach : {0, 1, 3, 30}) {
        std::vector<uint64_t> farthest;
        farthestWithin(tile, reach, farthest);
        for (int y = 7; y < 20; ++y) {
            for (int x = 5; x < 28; ++x) {
                uint64_t expected = 0;
                for (int v = std::max(7, y - reach); v < std::min(20, y + reach + 1); ++v) {
                    for (int u = std::max(5, x - reach); u < std::min(28, x + reach + 1); ++u)
                        expected = std::max(expected, tile.row(v)[u]);
                }
                ASSERT_EQ(farthest[size_t((y - 7) * tile.stride() + x - 5)], expected)
                    << reach << " " << x << "," << y;
            }
        }
    }
}

}  // namespace
}  // namespace stipple
