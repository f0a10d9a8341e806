// SPDX-License-Identifier: Apache-2.0
// Noise, height fields and the terrain made of them.
#include <core/error.h>
#include <gtest/gtest.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/noise.h>
#include <algorithm>

namespace stipple {
namespace {

TEST(ProceduralNoise, derivativeMatchesDifferences) {
    const double step = 1e-5;
    for (int i = 0; i < 200; ++i) {
        const DVec2 p(i * 0.37 - 30.0, i * 0.91 - 77.0);
        const NoiseSample s = gradientNoise(9, p);
        const double dx =
            gradientNoise(9, p + DVec2(step, 0)).value - gradientNoise(9, p - DVec2(step, 0)).value;
        const double dy =
            gradientNoise(9, p + DVec2(0, step)).value - gradientNoise(9, p - DVec2(0, step)).value;
        EXPECT_NEAR(s.derivative.x, dx / (2 * step), 1e-5);
        EXPECT_NEAR(s.derivative.y, dy / (2 * step), 1e-5);
    }
}

TEST(ProceduralNoise, isBoundedWithMeanZero) {
    double sum2 = 0, sum3 = 0, low = 0, high = 0;
    const int n = 40000;
    for (int i = 0; i < n; ++i) {
        const double a = gradientNoise(4, DVec2(i * 0.713, i * -0.129)).value;
        const double b = gradientNoise(4, DVec3(i * 0.713, i * -0.129, i * 0.31));
        sum2 += a, sum3 += b;
        low = std::min({low, a, b}), high = std::max({high, a, b});
    }
    EXPECT_NEAR(sum2 / n, 0.0, 0.02);
    EXPECT_NEAR(sum3 / n, 0.0, 0.02);
    EXPECT_GE(low, -1.0);
    EXPECT_LE(high, 1.0);
    EXPECT_LT(low, -0.5);
    EXPECT_GT(high, 0.5);
}

TEST(ProceduralTerrain, heightsSpanTheRelief) {
    for (const char* style : {"meadow", "forest_floor", "mountain"}) {
        const TerrainParams params{
            .seed = 2, .size = 800.0, .resolution = 65, .relief = 42.0, .style = style};
        const HeightField field = makeHeightField(params);
        ASSERT_EQ(field.heights.size(), 65u * 65u);
        const auto [low, high] = std::minmax_element(field.heights.begin(), field.heights.end());
        EXPECT_FLOAT_EQ(*low, 0.0f);
        EXPECT_NEAR(*high, 42.0f, 1e-3f);
        EXPECT_EQ(field.heights, makeHeightField(params).heights);
    }
}

TEST(ProceduralTerrain, fieldInterpolatesAndClamps) {
    // A slope: y = 3 (x + 5) on 3 x 3 samples over 10 m, so the normal is (-3, 1, 0) / sqrt(10).
    HeightField field;
    field.columns = field.rows = 3;
    field.size = DVec2(10.0);
    field.heights = {0, 15, 30, 0, 15, 30, 0, 15, 30};
    EXPECT_NEAR(field.height(0.0, 0.0), 15.0, 1e-9);
    EXPECT_NEAR(field.height(2.5, -4.0), 22.5, 1e-9);
    EXPECT_NEAR(field.height(100.0, 100.0), 30.0, 1e-9);
    EXPECT_NEAR(field.height(-100.0, 0.0), 0.0, 1e-9);
    for (const double x : {-50.0, -5.0, -4.9, 0.0, 1.0, 5.0, 50.0}) {
        const Vec3 n = field.normal(x, x);
        EXPECT_NEAR(n.x, -3.0 / std::sqrt(10.0), 1e-6) << x;
        EXPECT_NEAR(n.y, 1.0 / std::sqrt(10.0), 1e-6) << x;
        EXPECT_NEAR(n.z, 0.0, 1e-6) << x;
    }
}

TEST(ProceduralTerrain, meshLiesOnTheFieldAndFacesUp) {
    const TerrainParams params{
        .size = 200.0, .resolution = 33, .relief = 20.0, .style = "mountain"};
    const HeightField field = makeHeightField(params);
    const GeneratedMesh terrain = makeTerrain(params, field);
    const Mesh& mesh = terrain.mesh;
    ASSERT_EQ(mesh.triangles.size(), 2u * 32u * 32u);
    ASSERT_EQ(mesh.positions.size(), 33u * 33u);
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 p = mesh.positions[i];
        EXPECT_NEAR(p.y, field.height(p.x, p.z), 1e-3);
        EXPECT_NEAR(glm::length(mesh.normals[i]), 1.0f, 1e-5f);
        for (int c = 0; c < 3; ++c)
            EXPECT_TRUE(mesh.colors[i][c] >= 0.0f && mesh.colors[i][c] <= 1.0f);
    }
    for (const UVec3& t : mesh.triangles) {
        const Vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
        ASSERT_GT(glm::cross(b - a, c - a).y, 0.0f);
    }
}

TEST(ProceduralTerrain, mountainsHaveSnowAboveAndNotBelow) {
    const TerrainParams params{.size = 2000.0,
                               .resolution = 257,
                               .relief = 500.0,
                               .feature_size = 900.0,
                               .style = "mountain"};
    const GeneratedMesh terrain = makeTerrain(params, makeHeightField(params));
    size_t white_above = 0, white_below = 0;
    for (size_t i = 0; i < terrain.mesh.positions.size(); ++i) {
        if (terrain.mesh.colors[i].x < 0.7f) continue;
        (terrain.mesh.positions[i].y > 200.0f ? white_above : white_below) += 1;
    }
    EXPECT_GT(white_above, 200u);
    EXPECT_EQ(white_below, 0u);
}

TEST(ProceduralTerrain, erosionCutsValleysThatDrain) {
    TerrainParams params{.seed = 6, .size = 2000.0, .resolution = 129, .relief = 300.0};
    // Places lower than all eight around, but for the border: hollows.
    const auto hollows = [](const HeightField& f) {
        int count = 0;
        for (int j = 1; j + 1 < f.columns; ++j) {
            for (int i = 1; i + 1 < f.columns; ++i) {
                const float* h = f.heights.data() + j * f.columns + i;
                bool lowest = true;
                for (int d = 0; d < 9; ++d) {
                    if (d != 4 && h[(d / 3 - 1) * f.columns + d % 3 - 1] <= *h) lowest = false;
                }
                count += lowest;
            }
        }
        return count;
    };
    const HeightField before = makeHeightField(params);
    params.erosion = 1.0;
    const HeightField after = makeHeightField(params);
    EXPECT_LT(hollows(after), hollows(before));
    EXPECT_NE(before.heights, after.heights);
    EXPECT_EQ(after.heights, makeHeightField(params).heights);
    const auto [low, high] = std::minmax_element(after.heights.begin(), after.heights.end());
    EXPECT_NEAR(*low, 0.0f, 1e-3f);
    EXPECT_NEAR(*high, 300.0f, 1e-2f);
}

TEST(ProceduralTerrain, waterCoversWhatIsBelowIt) {
    const TerrainParams params{.seed = 2,
                               .size = 1000.0,
                               .resolution = 65,
                               .relief = 100.0,
                               .erosion = 0.5,
                               .water_level = 30.0};
    const HeightField field = makeHeightField(params);
    const GeneratedMesh terrain = makeTerrain(params, field);
    ASSERT_EQ(terrain.materials.size(), 2u);
    EXPECT_EQ(terrain.materials[1].name, "water");
    size_t wet = 0, covered = 0;
    for (int j = 0; j + 1 < 65; ++j) {
        for (int i = 0; i + 1 < 65; ++i) {
            const float* h = field.heights.data() + j * 65 + i;
            wet += std::min({h[0], h[1], h[65], h[66]}) < 30.0f;
        }
    }
    for (size_t t = 0; t < terrain.mesh.triangles.size(); ++t) {
        if (terrain.mesh.triangle_material[t] != 1) continue;
        ++covered;
        for (int c = 0; c < 3; ++c)
            EXPECT_EQ(terrain.mesh.positions[terrain.mesh.triangles[t][c]].y, 30.0f);
    }
    EXPECT_GT(wet, 50u);
    EXPECT_EQ(covered, 2 * wet);
    const GeneratedMesh dry = makeTerrain({.water_level = 0.0}, makeHeightField({}));
    EXPECT_EQ(dry.materials.size(), 1u);
    EXPECT_TRUE(dry.textures.empty());
    EXPECT_TRUE(dry.mesh.uvs.empty());
}

// What samples are too far apart to show would be noise from vertex to vertex, drawn out along the
// triangles' edges: neighbours would differ as much as places far from each other.
TEST(ProceduralTerrain, coloursHoldNothingFinerThanTheSamples) {
    for (const double step : {4.0, 9.0, 40.0}) {
        HeightField field;
        field.columns = field.rows = 65;
        field.size = DVec2(64.0 * step);
        field.heights.assign(65 * 65, 0.0f);
        const GeneratedMesh terrain = makeTerrain({.style = "meadow"}, field);
        const auto difference = [&](int apart) {
            double sum = 0.0;
            for (int j = 0; j < 65; ++j) {
                for (int i = 0; i + apart < 65; ++i) {
                    const size_t v = size_t(j * 65 + i);
                    sum += std::abs(terrain.mesh.colors[v].y -
                                    terrain.mesh.colors[v + size_t(apart)].y);
                }
            }
            return sum / (65.0 * (65.0 - apart));
        };
        EXPECT_GT(difference(12), 1e-4) << step;
        EXPECT_LT(difference(1), 0.65 * difference(12)) << step;
    }
}

TEST(ProceduralTerrain, mountainsErodeWithinTheirRelief) {
    const TerrainParams params{.seed = 3,
                               .size = 4000.0,
                               .resolution = 257,
                               .relief = 800.0,
                               .feature_size = 2000.0,
                               .style = "mountain",
                               .erosion = 0.7,
                               .water_level = 60.0};
    const HeightField field = makeHeightField(params);
    const auto [low, high] = std::minmax_element(field.heights.begin(), field.heights.end());
    EXPECT_GE(*low, 0.0f);
    EXPECT_LE(*high, 800.01f);
    EXPECT_GT(*high, 770.0f);  // summits stay
    EXPECT_EQ(field.heights, makeHeightField(params).heights);
}

// The map repeats without a seam, leans no way as a whole, and is about as steep as wind makes it.
TEST(ProceduralTerrain, ripplesAreATileableNormalMap) {
    const TerrainParams params{.resolution = 65, .relief = 60.0, .water_level = 20.0};
    const GeneratedMesh terrain = makeTerrain(params, makeHeightField(params));
    ASSERT_EQ(terrain.textures.size(), 1u);
    EXPECT_EQ(terrain.mesh.uvs.size(), terrain.mesh.positions.size());
    EXPECT_EQ(terrain.materials[0].normal_map.texture, kNoTexture);
    EXPECT_EQ(terrain.materials[1].normal_map.texture, 0);
    const Texture& map = terrain.textures[0];
    const Texture::Level& level = map.levels[0];
    const double scale = double(terrain.materials[1].normal_scale);
    const auto slope = [&](int x, int y, int c) {
        return scale * (level.rgba[size_t((y * level.width + x) * 4 + c)] / 127.5 - 1.0);
    };
    double sum2 = 0.0, seam = 0.0, inside = 0.0;
    const int n = level.width;
    ASSERT_EQ(level.height, n);
    for (int i = 0; i < n; ++i) {
        for (int k = 0; k < n; ++k) {
            for (int c = 0; c < 2; ++c) sum2 += slope(i, k, c) * slope(i, k, c);
        }
        for (int c = 0; c < 2; ++c) {
            seam += std::abs(slope(0, i, c) - slope(n - 1, i, c)) +
                    std::abs(slope(i, 0, c) - slope(i, n - 1, c));
            inside += std::abs(slope(n / 2, i, c) - slope(n / 2 - 1, i, c)) +
                      std::abs(slope(i, n / 2, c) - slope(i, n / 2 - 1, c));
        }
    }
    EXPECT_NEAR(std::sqrt(sum2 / double(n * n)), 0.09, 0.01);
    EXPECT_LT(seam, 1.5 * inside);
    const Texture::Level& mean = map.levels.back();
    ASSERT_EQ(mean.width, 1);
    for (int c = 0; c < 2; ++c) EXPECT_NEAR(mean.rgba[size_t(c)], 127.5, 3.0);
}

TEST(ProceduralTerrain, flatReliefStaysFinite) {
    for (const char* style : {"meadow", "mountain"}) {
        const TerrainParams flooded{
            .resolution = 33, .relief = 20.0, .style = style, .erosion = 1.0, .water_level = 50.0};
        for (const float h : makeHeightField(flooded).heights) EXPECT_TRUE(h >= 0.0f && h <= 20.0f);
        const TerrainParams even{.resolution = 33, .relief = 0.0, .style = style, .erosion = 1.0};
        for (const float h : makeHeightField(even).heights) EXPECT_EQ(h, 0.0f);
    }
    const TerrainParams params{.resolution = 2, .relief = 0.0};
    const HeightField field = makeHeightField(params);
    for (const float h : field.heights) EXPECT_EQ(h, 0.0f);
    const GeneratedMesh terrain = makeTerrain(params, field);
    for (const Vec3& n : terrain.mesh.normals) EXPECT_EQ(n, Vec3(0, 1, 0));
}

TEST(ProceduralTerrain, refusesNonsense) {
    EXPECT_THROW(makeHeightField({.resolution = 1}), Error);
    EXPECT_THROW(makeHeightField({.resolution = 1 << 20}), Error);
    EXPECT_THROW(makeHeightField({.size = -5.0}), Error);
    EXPECT_THROW(makeHeightField({.relief = std::nan("")}), Error);
    EXPECT_THROW(makeHeightField({.style = "moon"}), Error);
    EXPECT_THROW(makeHeightField({.erosion = 2.0}), Error);
    EXPECT_THROW(makeHeightField({.water_level = -1.0}), Error);
}

}  // namespace
}  // namespace stipple
