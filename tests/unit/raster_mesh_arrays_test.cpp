// SPDX-License-Identifier: Apache-2.0
// The order of vertices and the runs that the rasterizer draws from.
#include <raster/mesh_arrays.h>

#include <gtest/gtest.h>

#include <random>

namespace stipple {
namespace {

struct Arrays {
    std::vector<Vec3> positions;
    std::vector<Vec2> uvs;
    std::vector<Vec4> colors;
    std::vector<UVec3> triangles;
    std::vector<uint16_t> materials;

    RasterMesh mesh() const { return {&positions, &uvs, &colors, &triangles, &materials}; }
};

// Corners in cyclic order from the smallest, so that only winding and places count.
std::vector<Vec3> corners(const std::vector<Vec3>& positions, const UVec3& t) {
    std::vector<Vec3> c = {positions[t.x], positions[t.y], positions[t.z]};
    const auto less = [](const Vec3& a, const Vec3& b) {
        return std::lexicographical_compare(&a.x, &a.x + 3, &b.x, &b.x + 3);
    };
    std::rotate(c.begin(), std::min_element(c.begin(), c.end(), less), c.end());
    return c;
}

TEST(RasterMeshArrays, keepsTrianglesAndGivesEachItsOwnLastCorner) {
    std::mt19937 random(7);
    for (const uint32_t n_vertices : {3u, 7u, 300u}) {
        Arrays a;
        for (uint32_t i = 0; i < n_vertices; ++i)
            a.positions.emplace_back(float(i), float(random() % 100), 1.0f);
        for (int i = 0; i < 400; ++i) {
            const uint32_t v = random() % n_vertices;
            a.triangles.emplace_back(v, (v + 1) % n_vertices, (v + 2) % n_vertices);
        }
        a.materials.assign(a.triangles.size(), 0);
        const MeshArrays made = makeMeshArrays(a.mesh(), {Material{}}, {});
        ASSERT_EQ(made.triangles.size(), a.triangles.size());
        for (uint32_t t = 0; t < a.triangles.size(); ++t) {
            EXPECT_EQ(made.triangles[t].z, t);
            EXPECT_EQ(corners(made.positions, made.triangles[t]),
                      corners(a.positions, a.triangles[t]));
        }
    }
}

TEST(RasterMeshArrays, copiesNoVertexOfLooseQuads) {
    Arrays a;
    for (uint32_t i = 0; i < 10; ++i) {
        for (int k = 0; k < 4; ++k) a.positions.emplace_back(float(i), float(k & 1), float(k >> 1));
        a.triangles.emplace_back(4 * i, 4 * i + 1, 4 * i + 2);
        a.triangles.emplace_back(4 * i + 2, 4 * i + 1, 4 * i + 3);
    }
    a.materials.assign(a.triangles.size(), 0);
    EXPECT_EQ(makeMeshArrays(a.mesh(), {Material{}}, {}).positions.size(), a.positions.size());
}

TEST(RasterMeshArrays, splitsByWhatTheMaterialsNeed) {
    std::vector<Material> materials(6);
    materials[1].double_sided = true;
    for (int i = 2; i < 6; ++i) materials[i].alpha_mode = AlphaMode::kMask;
    materials[2].base_texture = 0;  // alpha 0..1: masked
    materials[3].base_texture = 1;  // alpha 0.8..1: never below the cutoff
    materials[4].alpha = 0.25f;     // always below it
    materials[5].alpha_mode = AlphaMode::kBlend,
    materials[5].alpha = 0.75f;  // above the cutoff of blended surfaces
    Arrays a;
    a.positions = {Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
    a.uvs.resize(3);
    a.materials = {0, 0, 3, 5, 1, 2, 2, 4};
    a.triangles.assign(a.materials.size(), UVec3(0, 1, 2));
    const MeshArrays made = makeMeshArrays(a.mesh(), materials, {{0.0f, 1.0f}, {0.8f, 1.0f}});
    ASSERT_EQ(made.runs.size(), 4u);
    EXPECT_EQ(made.runs[0].count, 4u);
    EXPECT_EQ(made.runs[0].state, SurfaceState{});
    EXPECT_TRUE(made.runs[1].state.double_sided);
    EXPECT_EQ(made.runs[2].first, 5u);
    EXPECT_EQ(made.runs[2].count, 2u);
    EXPECT_EQ(made.runs[2].state.masked_material, 2);
    EXPECT_FALSE(made.runs[2].state.hidden);
    EXPECT_TRUE(made.runs[3].state.hidden);
    EXPECT_EQ(made.masks.size(), made.positions.size());

    a.colors = {Vec4(1), Vec4(1),
                Vec4(1, 1, 1, 0)};  // vertex alpha masks what the material alone would not
    EXPECT_EQ(makeMeshArrays(a.mesh(), materials, {{0.0f, 1.0f}, {0.8f, 1.0f}})
                  .runs[1]
                  .state.masked_material,
              3);
}

TEST(RasterMeshArrays, takesEmptyMeshes) {
    const Arrays a;
    const MeshArrays made = makeMeshArrays(a.mesh(), {}, {});
    EXPECT_TRUE(made.runs.empty());
    EXPECT_TRUE(made.bounds.isEmpty());
}

}  // namespace
}  // namespace stipple
