// SPDX-License-Identifier: Apache-2.0
// What can be seen of a mesh from afar: closed forms.
#include <gtest/gtest.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/visible_area.h>

namespace stipple {
namespace {

// Squares of 27 x 27 triangle pairs, facing up, one below the other.
Mesh stackOfSquares(int layers, float gap, const std::vector<Material>& materials) {
    constexpr int kCells = 27;  // no edge through the centres of cells
    Mesh mesh;
    for (int layer = 0; layer < layers; ++layer) {
        const uint32_t first = uint32_t(mesh.positions.size());
        for (int z = 0; z <= kCells; ++z) {
            for (int x = 0; x <= kCells; ++x)
                mesh.positions.push_back(
                    Vec3(float(x) / kCells, -gap * float(layer), float(z) / kCells));
        }
        for (uint32_t z = 0; z < kCells; ++z) {
            for (uint32_t x = 0; x < kCells; ++x) {
                const uint32_t a = first + z * (kCells + 1) + x, b = a + 1, c = a + kCells + 1,
                               d = c + 1;
                mesh.triangles.push_back({a, c, b});
                mesh.triangles.push_back({b, c, d});
            }
        }
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    buildMesh(mesh, materials, "stack");
    return mesh;
}

TEST(VisibleArea, directionsRoundTrip) {
    for (int i = 0; i < kDirections; ++i) {
        EXPECT_EQ(directionIndex(directionOf(i)), i);
        EXPECT_NEAR(glm::length(directionOf(i)), 1.0f, 1e-6f);
    }
}

TEST(VisibleArea, onlyTheTopOfAStackIsSeenFromAbove) {
    const std::vector<Material> materials(1);
    const Mesh mesh = stackOfSquares(3, 0.1f, materials);
    const VisibleArea seen = measureVisibleArea(mesh, materials, {}, Vec3(0, 1, 0));
    EXPECT_NEAR(seen.covered(), 1.0, 0.015);
    double below = 0.0;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
        if (mesh.positions[mesh.triangles[t].x].y < -0.05f)
            below += double(seen.cumulative[t + 1]) - double(seen.cumulative[t]);
    }
    EXPECT_EQ(below, 0.0);
    EXPECT_NEAR(seen.layers, 3.0f, 0.05f);
}

TEST(VisibleArea, singleSidedSurfacesAreNotSeenFromBehind) {
    std::vector<Material> materials(1);
    for (const bool double_sided : {false, true}) {
        materials[0].double_sided = double_sided;
        const Mesh mesh = stackOfSquares(1, 0.1f, materials);
        const VisibleArea seen = measureVisibleArea(mesh, materials, {}, Vec3(0, -1, 0));
        EXPECT_NEAR(seen.covered(), double_sided ? 1.0 : 0.0, 0.015);
    }
}

TEST(VisibleArea, halfOfASphereIsSeenFromAnywhere) {
    GeneratedMesh sphere = makePrimitive("sphere", 20000, Vec3(0.5f));
    buildMesh(sphere.mesh, sphere.materials, "sphere");
    for (const int direction : {0, 5, 14, 31}) {
        const VisibleArea seen =
            measureVisibleArea(sphere.mesh, sphere.materials, {}, directionOf(direction));
        EXPECT_NEAR(seen.covered() / sphere.mesh.area, 0.25, 0.01);
        const float diameter = sphere.mesh.bounds.extent().x;
        EXPECT_NEAR(seen.patch_width / diameter, 1.0f, 0.01f);
        EXPECT_NEAR(seen.layers, 1.0f, 1e-3f);  // its back is not drawn
    }
}

TEST(VisibleArea, affineMapsKeepShares) {
    const std::vector<Material> materials(1);
    Mesh mesh = stackOfSquares(2, 0.5f, materials);
    const Vec3 to_eye(0.3f, 1.0f, 0.4f), stretch(3.0f, 0.5f, 2.0f);
    const VisibleArea seen = measureVisibleArea(mesh, materials, {}, to_eye);
    Mesh stretched = mesh;
    for (Vec3& p : stretched.positions) p *= stretch;
    buildMesh(stretched, materials, "stretched");
    const VisibleArea after = measureVisibleArea(stretched, materials, {}, to_eye * stretch);
    const size_t half = mesh.triangles.size() / 2;
    EXPECT_NEAR(seen.cumulative[half] / seen.cumulative.back(),
                after.cumulative[half] / after.cumulative.back(), 0.02);
}

TEST(VisibleArea, theFartherTheLessOfTheWholeSurface) {
    TreeParams params;
    params.triangles = 8000;
    GeneratedMesh tree = makeTree(params);
    buildMesh(tree.mesh, tree.materials, "tree");
    const VisibleArea seen =
        measureVisibleArea(tree.mesh, tree.materials, {}, Vec3(1.0f, 0.3f, 0.2f));
    const SpacingTable& whole = seen.whole_factor;
    const SpacingTable& visible = seen.visible_factor;
    EXPECT_EQ(whole.at(0.0f), 1.0f);
    EXPECT_NEAR(visible.at(0.0f), 1.2f, 0.1f);
    for (size_t i = 1; i < size_t(SpacingTable::kOctaves); ++i)
        EXPECT_LE(whole.factors[i], whole.factors[i - 1]);
    EXPECT_LT(whole.at(1e4f * whole.first_spacing), 0.5f);
    EXPECT_GT(whole.at(4.0f * whole.first_spacing), 0.5f);
    // Points about as far apart as the gaps collide; a tree much smaller than that needs none more.
    EXPECT_GT(visible.at(2.0f * seen.patch_width), 1.3f);
    EXPECT_LT(visible.at(1e4f * visible.first_spacing), 1.05f);
}

}  // namespace
}  // namespace stipple
