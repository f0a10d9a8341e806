// SPDX-License-Identifier: Apache-2.0
// Scatter and grid: numbers, distribution, limits, orientation.
#include <core/error.h>
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/procedural/scatter.h>

#include <cmath>
#include <cstring>

namespace stipple {
namespace {

ThreadPool& twoThreads() {  // started once: some tests scatter a thousand times
    static ThreadPool pool(2);
    return pool;
}

InstanceStore scattered(const ScatterParams& params, const HeightField* field = nullptr) {
    const ScatterSurface surface{field, nullptr};
    InstanceStore store(scatterDomain(params, surface));
    scatter(params, surface, twoThreads(), store);
    return store;
}

InstanceStore placed(const GridParams& params) {
    InstanceStore store(gridDomain(params));
    placeGrid(params, twoThreads(), store);
    return store;
}

uint64_t hashStore(const InstanceStore& store) {
    uint64_t key = store.size();
    for (size_t i = 0; i < store.size(); ++i) {
        const Affine a = store.groupFromChild(i);
        for (int c = 0; c < 4; ++c) {
            const DVec3 v = c < 3 ? a.linear[c] : a.translation;
            for (int r = 0; r < 3; ++r) {
                uint64_t bits;
                std::memcpy(&bits, &v[r], sizeof bits);
                key = hashCombine(key, bits);
            }
        }
        key = hashCombine(key, store.child(i).bits);
    }
    return key;
}

double scaleOf(const Affine& a) { return std::cbrt(glm::determinant(a.linear)); }
double leanOf(const Affine& a) {
    return std::acos(std::clamp(a.linear[1].y / glm::length(a.linear[1]), -1.0, 1.0));
}

ScatterParams oneKind(uint64_t count) {
    ScatterParams params;
    params.items = {{ChildRef::mesh(7), 1.0}};
    params.count = count;
    return params;
}

// A ramp along x: slope 45 degrees for x > 0, flat for x < 0.
HeightField ramp() {
    HeightField field;
    field.columns = field.rows = 101;
    field.size = DVec2(100.0);
    for (int j = 0; j < 101; ++j) {
        for (int i = 0; i < 101; ++i) field.heights.push_back(float(std::max(0, i - 50)));
    }
    return field;
}

TEST(ProceduralScatter, placesAboutTheWantedNumber) {
    for (const uint64_t count : {1ull, 2ull, 50ull, 9000ull, 100000ull}) {
        double total = 0.0;
        const int seeds = count < 1000 ? 400 : 4;
        for (int seed = 0; seed < seeds; ++seed) {
            ScatterParams params = oneKind(count);
            params.seed = uint64_t(seed);
            total += double(scattered(params).size());
        }
        // Five standard deviations of a binomial with more spread than any cell has.
        EXPECT_NEAR(total, double(count) * seeds, 5.0 * std::sqrt(double(count) * seeds)) << count;
    }
    EXPECT_EQ(scattered(oneKind(0)).size(), 0u);
}

TEST(ProceduralScatter, clusteringKeepsTheMeanOverManyThickets) {
    ScatterParams params = oneKind(200000);
    params.size = DVec2(6000.0);  // 10^4 thickets
    params.clustering = 1.0;
    const InstanceStore store = scattered(params);
    EXPECT_NEAR(double(store.size()), 200000.0, 0.04 * 200000.0);
    // Counts in cells of 30 m vary far more than Poisson's (5).
    std::vector<int> cells(200 * 200, 0);
    for (size_t i = 0; i < store.size(); ++i) {
        const DVec3 p = store.groupFromChild(i).translation;
        const int x = std::clamp(int((p.x + 3000.0) / 30.0), 0, 199),
                  z = std::clamp(int((p.z + 3000.0) / 30.0), 0, 199);
        ++cells[size_t(z * 200 + x)];
    }
    double variance = 0.0;
    for (const int c : cells) variance += (c - 5.0) * (c - 5.0) / double(cells.size());
    EXPECT_GT(variance, 10.0);
}

TEST(ProceduralScatter, isUniformOverTheSquare) {
    ScatterParams params = oneKind(100000);
    params.size = DVec2(64.0);
    params.center = DVec2(10.0, -20.0);
    const InstanceStore store = scattered(params);
    constexpr int kSide = 16;
    double cells[kSide * kSide] = {};
    for (size_t i = 0; i < store.size(); ++i) {
        const DVec3 p = store.groupFromChild(i).translation;
        const double u = (p.x - 10.0) / 64.0 + 0.5, v = (p.z + 20.0) / 64.0 + 0.5;
        ASSERT_TRUE(u >= 0.0 && u <= 1.0 && v >= 0.0 && v <= 1.0);
        cells[std::min(int(v * kSide), kSide - 1) * kSide + std::min(int(u * kSide), kSide - 1)] +=
            1.0;
    }
    const double expected = double(store.size()) / (kSide * kSide);
    double chi_square = 0.0;
    for (const double c : cells) chi_square += (c - expected) * (c - expected) / expected;
    EXPECT_LT(chi_square,
              345.0);  // 255 degrees of freedom, p = 1.5e-4; a jittered grid stays far below
}

TEST(ProceduralScatter, honoursLimitsOfSlopeAndHeight) {
    const HeightField field = ramp();
    ScatterParams params = oneKind(20000);
    params.max_slope = radians(30.0);
    const InstanceStore flat = scattered(params, &field);
    ASSERT_GT(flat.size(), 8000u);
    for (size_t i = 0; i < flat.size(); ++i) {
        const DVec3 p = flat.groupFromChild(i).translation;
        ASSERT_LT(p.x, 1.0);
        ASSERT_NEAR(p.y, field.height(p.x, p.z), 1e-4);
    }
    params.max_slope = 0.5 * kPi;
    params.min_slope = radians(30.0);
    params.min_height = 10.0;
    params.max_height = 20.0;
    params.sink = 0.5;
    const InstanceStore steep = scattered(params, &field);
    EXPECT_NEAR(double(steep.size()), 2000.0, 250.0);
    for (size_t i = 0; i < steep.size(); ++i) {
        const DVec3 p = steep.groupFromChild(i).translation;
        ASSERT_TRUE(p.y >= 9.5 - 1e-4 && p.y <= 19.5 + 1e-4);
        ASSERT_NEAR(p.x, p.y + 0.5, 1e-3);
    }
}

TEST(ProceduralScatter, scalesLeansAndAligns) {
    ScatterParams params = oneKind(5000);
    params.min_scale = 0.5;
    params.max_scale = 2.0;
    params.tilt = 0.2;
    const InstanceStore flat = scattered(params);
    double least_scale = 9.0, most_scale = 0.0, most_lean = 0.0, turn_x = 0.0, turn_z = 0.0;
    for (size_t i = 0; i < flat.size(); ++i) {
        const Affine a = flat.groupFromChild(i);
        least_scale = std::min(least_scale, scaleOf(a)),
        most_scale = std::max(most_scale, scaleOf(a));
        most_lean = std::max(most_lean, leanOf(a));
        turn_x += a.linear[0].x / scaleOf(a), turn_z += a.linear[0].z / scaleOf(a);
    }
    EXPECT_GE(least_scale, 0.5 - 1e-5);
    EXPECT_LT(least_scale, 0.52);
    EXPECT_LE(most_scale, 2.0 + 1e-5);
    EXPECT_GT(most_scale, 1.98);
    EXPECT_LE(most_lean, 0.2 + 1e-5);
    EXPECT_GT(most_lean, 0.19);
    // All directions alike: the mean of unit vectors has a standard deviation of sqrt(n / 2) along
    // each axis.
    EXPECT_LT(std::hypot(turn_x, turn_z), 5.0 * std::sqrt(double(flat.size())));

    const HeightField field = ramp();
    params.tilt = 0.0;
    params.align = 1.0;
    params.min_slope = radians(44.0);
    const InstanceStore steep = scattered(params, &field);
    ASSERT_GT(steep.size(), 1000u);
    for (size_t i = 0; i < steep.size(); ++i) {
        const Affine a = steep.groupFromChild(i);
        const DVec3 up = a.linear[1] / scaleOf(a);
        ASSERT_NEAR(glm::dot(up, DVec3(-std::sqrt(0.5), std::sqrt(0.5), 0.0)), 1.0, 1e-3);
    }
}

TEST(ProceduralScatter, choosesKindsByWeight) {
    ScatterParams params = oneKind(20000);
    params.items = {{ChildRef::mesh(0), 0.0}, {ChildRef::mesh(1), 1.0}, {ChildRef::group(2), 3.0}};
    const InstanceStore store = scattered(params);
    double groups = 0.0;
    for (size_t i = 0; i < store.size(); ++i) {
        ASSERT_NE(store.child(i), ChildRef::mesh(0));
        groups += store.child(i) == ChildRef::group(2);
    }
    const double n = double(store.size());
    EXPECT_NEAR(groups, 0.75 * n, 5.0 * std::sqrt(n * 0.75 * 0.25));
}

TEST(ProceduralScatter, dependsOnTheSeedOnly) {
    ScatterParams params = oneKind(3000);
    params.tilt = 0.1;
    const uint64_t first = hashStore(scattered(params));
    EXPECT_EQ(first, hashStore(scattered(params)));
    params.seed = 2;
    EXPECT_NE(first, hashStore(scattered(params)));
}

TEST(ProceduralScatter, staysWithinItsDomain) {
    // Outside of it an instance would cost four times the memory.
    const HeightField field = ramp();
    ScatterParams params = oneKind(10000);
    params.sink = 2.0;
    EXPECT_LE(scattered(params, &field).bytes(), 11000u * 32u);
    GridParams grid;
    grid.count_x = grid.count_z = 50;
    grid.jitter = 0.4;
    grid.hill_height = -30.0;
    EXPECT_LE(placed(grid).bytes(), 2500u * 32u);
}

TEST(ProceduralScatter, keepsTheSpacingAndFillsTheSquare) {
    ScatterParams params = oneKind(uint64_t(1) << 27);
    params.size = DVec2(60.0, 30.0);
    params.spacing = 2.0;
    const InstanceStore store = scattered(params);
    // Between half and all of the densest packing there is (2 / sqrt(3) a squared spacing).
    EXPECT_GT(store.size(), 60u * 30u / 4u / 2u);
    EXPECT_LT(store.size(), size_t(1.16 * 60 * 30 / 4));
    double nearest = 1e9;
    for (size_t i = 0; i < store.size(); ++i) {
        for (size_t j = 0; j < i; ++j) {
            nearest = std::min(nearest, glm::length(store.groupFromChild(i).translation -
                                                    store.groupFromChild(j).translation));
        }
    }
    EXPECT_GE(nearest, 2.0 - 1e-6);
    EXPECT_LT(nearest, 2.1);
    params.count = 20;
    EXPECT_EQ(scattered(params).size(), 20u);
}

TEST(ProceduralScatter, standsOnTrianglesEvenlyAndAlongTheirNormals) {
    // A sphere of diameter 20 about (5, 0, 0), from a mesh of diameter 1.
    const GeneratedMesh ball = makePrimitive("sphere", 20000, Vec3(1.0f));
    const TriangleSurface triangles({{&ball.mesh, {DMat3(20.0), DVec3(5, 0, 0)}}});
    EXPECT_NEAR(triangles.area(), 400.0 * kPi, 5.0);
    const ScatterSurface surface{nullptr, &triangles};
    ScatterParams params = oneKind(20000);
    params.align = 1.0;
    params.max_slope = kPi;
    params.sink = 1.0;
    ThreadPool one(1), three(3);
    InstanceStore store(scatterDomain(params, surface)), again(scatterDomain(params, surface));
    scatter(params, surface, one, store);
    scatter(params, surface, three, again);
    EXPECT_EQ(hashStore(store), hashStore(again));
    EXPECT_EQ(store.size(), 20000u);
    int upper = 0;
    for (size_t i = 0; i < store.size(); ++i) {
        const Affine a = store.groupFromChild(i);
        const DVec3 from_center = a.translation - DVec3(5, 0, 0);
        ASSERT_NEAR(glm::length(from_center), 9.0, 0.02);
        ASSERT_GT(glm::dot(glm::normalize(a.linear[1]), glm::normalize(from_center)), 0.999);
        ASSERT_GT(glm::determinant(a.linear), 0.0);
        upper += from_center.y > 4.5;  // a quarter of the sphere's area, by Archimedes
    }
    EXPECT_NEAR(upper, 5000, 250);
    params.max_slope = radians(60.0);
    InstanceStore top(scatterDomain(params, surface));
    scatter(params, surface, one, top);
    EXPECT_NEAR(double(top.size()), 5000, 250);
    for (size_t i = 0; i < top.size(); ++i) ASSERT_GT(top.groupFromChild(i).translation.y, 4.4);
}

TEST(ProceduralScatter, isTheSameForAnyNumberOfThreads) {
    for (const double spacing : {0.0, 0.8}) {
        ScatterParams params = oneKind(100000);
        params.clustering = 0.5;
        params.tilt = 0.1;
        params.spacing = spacing;
        GridParams grid;
        grid.count_x = 500, grid.count_z = 301;
        grid.any_turn = true;
        uint64_t hashes[2];
        for (int t : {1, 4}) {
            ThreadPool pool(t);
            InstanceStore store(scatterDomain(params, {}));
            scatter(params, {}, pool, store);
            placeGrid(grid, pool, store);
            hashes[t > 1] = hashStore(store);
        }
        EXPECT_EQ(hashes[0], hashes[1]);
    }
}

TEST(ProceduralScatter, refusesNonsense) {
    const auto refused = [](auto&& change) {
        ScatterParams params = oneKind(10);
        change(params);
        InstanceStore store;
        ThreadPool pool(1);
        EXPECT_THROW(scatter(params, {}, pool, store), Error);
    };
    refused([](ScatterParams& p) { p.items.clear(); });
    refused([](ScatterParams& p) { p.items[0].weight = 0.0; });
    refused([](ScatterParams& p) { p.items[0].weight = -1.0; });
    refused([](ScatterParams& p) { p.count = uint64_t(1) << 40; });
    refused([](ScatterParams& p) { p.size.x = std::nan(""); });
    refused([](ScatterParams& p) { p.min_scale = 0.0; });
    refused([](ScatterParams& p) { p.clustering = 2.0; });
}

TEST(ProceduralGrid, putsOneChildInEveryCell) {
    GridParams params;
    params.child = ChildRef::group(3);
    params.count_x = 5;
    params.count_z = 3;
    params.spacing_x = 2.0;
    params.spacing_z = 10.0;
    const InstanceStore store = placed(params);
    ASSERT_EQ(store.size(), 15u);
    int seen[3][5] = {};
    for (size_t i = 0; i < store.size(); ++i) {
        const Affine a = store.groupFromChild(i);
        EXPECT_EQ(store.child(i), ChildRef::group(3));
        EXPECT_EQ(a.linear, DMat3(1.0));
        const int x = int(std::lround(a.translation.x / 2.0)) + 2,
                  z = int(std::lround(a.translation.z / 10.0)) + 1;
        EXPECT_NEAR(a.translation.x, (x - 2) * 2.0, 1e-6);
        EXPECT_NEAR(a.translation.y, 0.0, 1e-6);
        ASSERT_TRUE(x >= 0 && x < 5 && z >= 0 && z < 3);
        ++seen[z][x];
    }
    for (auto& row : seen) {
        for (const int count : row) EXPECT_EQ(count, 1);
    }
}

TEST(ProceduralGrid, turnsJittersScalesAndRises) {
    GridParams params;
    params.count_x = params.count_z = 60;
    params.spacing_x = params.spacing_z = 4.0;
    params.jitter = 1.0;
    params.quarter_turns = true;
    params.min_scale = 0.9;
    params.max_scale = 1.1;
    params.hill_height = 12.0;
    params.hill_size = 50.0;
    const InstanceStore store = placed(params);
    ASSERT_EQ(store.size(), 3600u);
    int turns[4] = {};
    double low = 1e9, high = -1e9;
    for (size_t i = 0; i < store.size(); ++i) {
        const Affine a = store.groupFromChild(i);
        const DVec3 x = a.linear[0] / scaleOf(a);
        ASSERT_NEAR(std::max(std::abs(x.x), std::abs(x.z)), 1.0, 1e-6);
        ++turns[std::abs(x.x) > 0.5 ? (x.x > 0 ? 0 : 1) : (x.z > 0 ? 2 : 3)];
        ASSERT_TRUE(scaleOf(a) > 0.8999 && scaleOf(a) < 1.1001);
        low = std::min(low, a.translation.y), high = std::max(high, a.translation.y);
    }
    for (const int t : turns) EXPECT_NEAR(t, 900, 130);
    EXPECT_GE(low, -1e-6);
    EXPECT_LE(high, 12.0 + 1e-6);
    EXPECT_GT(high - low, 6.0);
    EXPECT_EQ(hashStore(store), hashStore(placed(params)));
}

TEST(ProceduralGrid, refusesNonsense) {
    InstanceStore store;
    ThreadPool pool(1);
    GridParams params;
    params.count_x = 0;
    EXPECT_THROW(placeGrid(params, pool, store), Error);
    params.count_x = params.count_z = 4000000000u;
    EXPECT_THROW(placeGrid(params, pool, store), Error);
    params.count_x = params.count_z = 2;
    params.spacing_x = std::nan("");
    EXPECT_THROW(placeGrid(params, pool, store), Error);
}

}  // namespace
}  // namespace stipple
