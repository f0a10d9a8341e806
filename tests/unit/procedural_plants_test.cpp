// SPDX-License-Identifier: Apache-2.0
// Trees, grass, rocks and primitives: sizes, sane geometry, determinism.
#include <core/error.h>
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/procedural/generators.h>

#include <cstring>
#include <numeric>
#include <utility>

namespace stipple {
namespace {

template <class T>
uint64_t hashBytes(uint64_t key, const std::vector<T>& values) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
    for (size_t i = 0; i < values.size() * sizeof(T); ++i) key = hashCombine(key, bytes[i]);
    return key;
}

uint64_t hashMesh(const Mesh& mesh) {
    uint64_t key = hashBytes(1, mesh.positions);
    key = hashBytes(key, mesh.normals);
    key = hashBytes(key, mesh.colors);
    return hashBytes(key, mesh.triangles);
}

Box3 boundsOf(const Mesh& mesh) {
    Box3 box;
    for (const Vec3& p : mesh.positions) box.extend(p);
    return box;
}

double areaVolume(const Mesh& mesh) {  // signed volume of a closed mesh
    double volume = 0.0;
    for (const UVec3& t : mesh.triangles) {
        volume += glm::dot(DVec3(mesh.positions[t.x]),
                           glm::cross(DVec3(mesh.positions[t.y]), DVec3(mesh.positions[t.z]))) /
                  6.0;
    }
    return volume;
}

void expectSane(const GeneratedMesh& g) {
    const Mesh& mesh = g.mesh;
    ASSERT_FALSE(mesh.triangles.empty());
    EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
    EXPECT_TRUE(mesh.colors.empty() || mesh.colors.size() == mesh.positions.size());
    EXPECT_EQ(mesh.triangle_material.size(), mesh.triangles.size());
    size_t bad_position = 0, bad_normal = 0, bad_color = 0, bad_index = 0, flat = 0;
    for (const Vec3& p : mesh.positions) bad_position += !isFinite(DVec3(p));
    for (const Vec3& n : mesh.normals) bad_normal += !(std::abs(glm::length(n) - 1.0f) < 1e-4f);
    for (const Vec4& c : mesh.colors) {
        for (int i = 0; i < 4; ++i) bad_color += !(c[i] >= 0.0f && c[i] <= 1.0f);
    }
    for (const UVec3& t : mesh.triangles) {
        if (t.x >= mesh.positions.size() || t.y >= mesh.positions.size() ||
            t.z >= mesh.positions.size()) {
            ++bad_index;
            continue;
        }
        const Vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
        flat += !(glm::length(glm::cross(b - a, c - a)) > 0.0f);
    }
    for (const uint16_t m : mesh.triangle_material) bad_index += m >= g.materials.size();
    EXPECT_EQ(bad_position, 0u);
    EXPECT_EQ(bad_normal, 0u);
    EXPECT_EQ(bad_color, 0u);
    EXPECT_EQ(bad_index, 0u);
    EXPECT_EQ(flat, 0u);
}

TEST(ProceduralTree, hasTheWantedTrianglesAndHeight) {
    for (const std::string& species : treeSpecies()) {
        for (const int triangles : {2000, 20000, 200000}) {
            SCOPED_TRACE(species + " " + std::to_string(triangles));
            const GeneratedMesh tree =
                makeTree({.species = species, .seed = 3, .triangles = triangles});
            expectSane(tree);
            EXPECT_NEAR(double(tree.mesh.triangles.size()), triangles, 0.1 * triangles);
            const Box3 box = boundsOf(tree.mesh);
            EXPECT_GT(box.max.y, 12.0f);
            EXPECT_LT(box.max.y, 30.0f);
            EXPECT_LT(box.min.y, 0.0f);
            EXPECT_GT(box.min.y, -0.7f);
            // The trunk stands at the origin, under the crown.
            EXPECT_LT(std::abs(box.center().x), 0.15f * box.max.y);
            EXPECT_LT(std::abs(box.center().z), 0.15f * box.max.y);
            EXPECT_LT(std::max(box.extent().x, box.extent().z), 1.2f * box.max.y);
        }
    }
}

TEST(ProceduralTree, scalesToTheHeightAsked) {
    const GeneratedMesh tree = makeTree({.species = "pine", .height = 7.5, .triangles = 4000});
    EXPECT_NEAR(boundsOf(tree.mesh).max.y, 7.5f, 1e-4f);
}

TEST(ProceduralTree, dependsOnTheSeedOnly) {
    for (const std::string& species : treeSpecies()) {
        const TreeParams params{.species = species, .seed = 11, .triangles = 5000};
        EXPECT_EQ(hashMesh(makeTree(params).mesh), hashMesh(makeTree(params).mesh));
        EXPECT_NE(hashMesh(makeTree(params).mesh),
                  hashMesh(makeTree({.species = species, .seed = 12, .triangles = 5000}).mesh));
    }
}

TEST(ProceduralTree, leavesAreSmallConnectedPatchesOnBothSides) {
    const GeneratedMesh tree = makeTree({.species = "oak", .triangles = 20000});
    std::vector<uint32_t> parent(tree.mesh.positions.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto find = [&](uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const UVec3& t : tree.mesh.triangles) {
        parent[find(t.x)] = find(t.y);
        parent[find(t.y)] = find(t.z);
    }
    std::vector<int> patch(parent.size(), 0);
    size_t leaf_triangles = 0;
    for (size_t i = 0; i < tree.mesh.triangles.size(); ++i) {
        if (tree.mesh.triangle_material[i] != 1) continue;
        ++leaf_triangles;
        ++patch[find(tree.mesh.triangles[i].x)];
    }
    EXPECT_LE(*std::max_element(patch.begin(), patch.end()), 4);
    EXPECT_GT(leaf_triangles, tree.mesh.triangles.size() / 2);
    EXPECT_TRUE(tree.materials[1].double_sided);
    EXPECT_FALSE(tree.materials[0].double_sided);
}

TEST(ProceduralTree, crownsAreDarkerInside) {
    // Mean brightness of leaves by their distance from the crown's axis at half height.
    const GeneratedMesh tree = makeTree({.species = "oak", .triangles = 20000});
    double sum[2] = {0, 0}, count[2] = {0, 0};
    for (size_t i = 0; i < tree.mesh.triangles.size(); ++i) {
        if (tree.mesh.triangle_material[i] != 1) continue;
        const uint32_t v = tree.mesh.triangles[i].y;
        const Vec3 p = tree.mesh.positions[v];
        const float r = std::sqrt(p.x * p.x + p.z * p.z);
        if (p.y < 7.0f || p.y > 11.0f || (r > 2.5f && r < 4.5f)) continue;
        sum[r >= 4.5f] += tree.mesh.colors[v].y;
        count[r >= 4.5f] += 1.0;
    }
    ASSERT_GT(count[0], 50.0);
    ASSERT_GT(count[1], 50.0);
    EXPECT_LT(sum[0] / count[0], 0.75 * sum[1] / count[1]);
}

// Mean linear colour of the triangles of a material, and their number.
std::pair<Vec3, size_t> meanColor(const GeneratedMesh& g, const std::string& material) {
    Vec3 sum(0.0f);
    size_t count = 0;
    for (size_t i = 0; i < g.mesh.triangles.size(); ++i) {
        const Material& m = g.materials[g.mesh.triangle_material[i]];
        if (m.name != material) continue;
        sum += m.base_color * Vec3(g.mesh.colors[g.mesh.triangles[i].y]);
        ++count;
    }
    return {count ? sum / float(count) : sum, count};
}

TEST(ProceduralTree, seasonsChangeColourAndAmountOfLeaves) {
    for (const char* species : {"oak", "beech", "birch"}) {
        SCOPED_TRACE(species);
        const auto leaves = [&](const char* season) {
            const GeneratedMesh tree =
                makeTree({.species = species, .triangles = 8000, .season = season});
            expectSane(tree);
            EXPECT_NEAR(double(tree.mesh.triangles.size()), 8000.0, 800.0) << season;
            return meanColor(tree, "leaves");
        };
        const auto [summer, n_summer] = leaves("summer");
        const auto [autumn, n_autumn] = leaves("autumn");
        EXPECT_GT(summer.y, summer.x);  // green
        EXPECT_GT(autumn.x, autumn.y);  // yellow to red
        EXPECT_LT(n_autumn, n_summer);
        EXPECT_LT(leaves("spring").second, n_summer);
        EXPECT_LT(leaves("winter").second, n_summer / 10);
    }
    const auto needles = [](const char* season) {
        return meanColor(makeTree({.species = "spruce", .triangles = 8000, .season = season}),
                         "needles")
            .second;
    };
    EXPECT_EQ(needles("winter"), needles("summer"));
    EXPECT_THROW(makeTree({.season = "monsoon"}), Error);
}

TEST(ProceduralBush, hasTheWantedTrianglesAndHeight) {
    for (const std::string& species : bushSpecies()) {
        for (const int triangles : {2000, 6000, 50000}) {
            SCOPED_TRACE(species + " " + std::to_string(triangles));
            const GeneratedMesh bush =
                makeBush({.species = species, .seed = 4, .height = 1.5, .triangles = triangles});
            expectSane(bush);
            EXPECT_NEAR(double(bush.mesh.triangles.size()), triangles, 0.1 * triangles);
            EXPECT_NEAR(boundsOf(bush.mesh).max.y, 1.5f, 1e-4f);
            EXPECT_GT(boundsOf(bush.mesh).min.y, -0.4f);
        }
    }
    EXPECT_THROW(makeBush({.species = "oak"}), Error);
    EXPECT_THROW(makeBush({.triangles = 10}), Error);
}

TEST(ProceduralDeadwood, liesOrStandsOnTheGround) {
    for (const std::string& form : deadwoodForms()) {
        for (const int triangles : {500, 4000, 40000}) {
            SCOPED_TRACE(form + " " + std::to_string(triangles));
            const GeneratedMesh wood =
                makeDeadwood({.form = form, .seed = 2, .length = 5.0, .triangles = triangles});
            expectSane(wood);
            EXPECT_LE(wood.mesh.triangles.size(), size_t(1.1 * triangles) + 200);
            const Box3 box = boundsOf(wood.mesh);
            const float length = form == "log" ? box.extent().x : box.max.y;
            EXPECT_NEAR(length, 5.0f, 0.6f);
            EXPECT_LT(box.min.y, 0.02f);
            EXPECT_GT(box.min.y, -1.5f);
        }
    }
    EXPECT_THROW(makeDeadwood({.form = "ash"}), Error);
    EXPECT_THROW(makeDeadwood({.length = -1.0}), Error);
    EXPECT_THROW(makeDeadwood({.triangles = 0}), Error);
}

TEST(ProceduralUndergrowth, staysWithinItsSizeAndCounts) {
    const GeneratedMesh fern = makeFern({.seed = 3, .height = 0.9, .fronds = 9});
    expectSane(fern);
    EXPECT_EQ(fern.mesh.triangles.size(), 9u * 73u);
    EXPECT_NEAR(boundsOf(fern.mesh).max.y, 0.9f, 1e-4f);
    const GeneratedMesh litter = makeLitter({.seed = 3, .radius = 2.0, .leaves = 500});
    expectSane(litter);
    EXPECT_LE(litter.mesh.triangles.size(), 1000u);
    EXPECT_GT(litter.mesh.triangles.size(), 900u);
    EXPECT_LT(boundsOf(litter.mesh).max.x, 2.7f);
    for (const std::string& species : flowerSpecies()) {
        SCOPED_TRACE(species);
        const GeneratedMesh flowers =
            makeFlowers({.species = species, .height = 0.5, .radius = 1.0, .stems = 20});
        expectSane(flowers);
        EXPECT_NEAR(boundsOf(flowers.mesh).max.y, 0.5f, 0.12f);
        EXPECT_LT(boundsOf(flowers.mesh).max.x, 1.5f);
        EXPECT_LE(flowers.mesh.triangles.size(), 20u * 70u);
    }
    EXPECT_THROW(makeFern({.fronds = 0}), Error);
    EXPECT_THROW(makeFern({.height = std::nan("")}), Error);
    EXPECT_THROW(makeLitter({.leaves = -1}), Error);
    EXPECT_THROW(makeLitter({.season = "never"}), Error);
    EXPECT_THROW(makeFlowers({.species = "nettle"}), Error);
    EXPECT_THROW(makeFlowers({.radius = -1.0}), Error);
}

TEST(ProceduralTree, refusesNonsense) {
    EXPECT_THROW(makeTree({.species = "palm"}), Error);
    EXPECT_THROW(makeTree({.triangles = 10}), Error);
    EXPECT_THROW(makeTree({.triangles = 1000000000}), Error);
    EXPECT_THROW(makeTree({.height = -1.0}), Error);
    EXPECT_THROW(makeTree({.height = std::nan("")}), Error);
}

TEST(ProceduralGrass, hasFiveTrianglesABladeWithinItsSize) {
    const GrassParams params{.seed = 5, .height = 0.4, .radius = 0.6, .blades = 300};
    const GeneratedMesh grass = makeGrass(params);
    expectSane(grass);
    EXPECT_EQ(grass.mesh.triangles.size(), 1500u);
    const Box3 box = boundsOf(grass.mesh);
    EXPECT_GT(box.max.y, 0.2f);
    EXPECT_LE(box.max.y, 0.4f);
    EXPECT_LE(box.max.x, 0.6f * 1.2f + 0.4f);
    EXPECT_EQ(hashMesh(grass.mesh), hashMesh(makeGrass(params).mesh));
    EXPECT_THROW(makeGrass({.blades = 0}), Error);
    EXPECT_THROW(makeGrass({.height = kInfinity}), Error);
}

TEST(ProceduralRock, isClosedAndRoughlyOfItsRadius) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
        const GeneratedMesh rock = makeRock({.seed = seed, .radius = 2.0, .subdivisions = 3});
        expectSane(rock);
        EXPECT_EQ(rock.mesh.triangles.size(), 20u * 64u);
        EXPECT_EQ(rock.mesh.positions.size(), rock.mesh.triangles.size() / 2 + 2);  // Euler: closed
        float largest = 0.0f;
        for (const Vec3& p : rock.mesh.positions) largest = std::max(largest, glm::length(p));
        EXPECT_NEAR(largest, 2.0f, 1e-4f);
        const double volume = areaVolume(rock.mesh), ball = 4.0 / 3.0 * kPi * 8.0;
        EXPECT_GT(volume, 0.15 * ball);
        EXPECT_LT(volume, 0.9 * ball);
        // Outward normals, on the whole.
        size_t outward = 0;
        for (size_t i = 0; i < rock.mesh.positions.size(); ++i) {
            outward += glm::dot(rock.mesh.positions[i], rock.mesh.normals[i]) > 0.0f;
        }
        EXPECT_GT(outward, rock.mesh.positions.size() * 95 / 100);
    }
    EXPECT_NE(hashMesh(makeRock({.seed = 1}).mesh), hashMesh(makeRock({.seed = 2}).mesh));
    EXPECT_THROW(makeRock({.subdivisions = 30}), Error);
}

TEST(ProceduralPrimitive, closedBodiesHaveTheirVolume) {
    const auto volume = [](const char* kind) {
        return areaVolume(makePrimitive(kind, 20000, Vec3(1)).mesh);
    };
    EXPECT_NEAR(volume("sphere"), kPi / 6.0, 2e-3);
    EXPECT_NEAR(volume("box"), 1.0, 1e-5);
    EXPECT_NEAR(volume("torus"), 2.0 * kPi * kPi * 0.35 * 0.15 * 0.15, 2e-3);
}

TEST(ProceduralPrimitive, hasAboutTheWantedTriangles) {
    for (const char* kind : {"sphere", "box", "plane", "torus"}) {
        for (const int triangles : {200, 5000, 100000}) {
            SCOPED_TRACE(kind);
            const GeneratedMesh body = makePrimitive(kind, triangles, Vec3(0.5f, 0.25f, 1.0f));
            expectSane(body);
            EXPECT_NEAR(double(body.mesh.triangles.size()), triangles, 0.15 * triangles);
            const Box3 box = boundsOf(body.mesh);
            EXPECT_NEAR(box.extent().x, 1.0f, 0.03f);
            EXPECT_NEAR(box.center().y, 0.0f, 1e-5f);
            EXPECT_EQ(body.materials.at(0).base_color, Vec3(0.5f, 0.25f, 1.0f));
            // Each triangle is counter-clockwise on the side of its normals.
            for (const UVec3& t : body.mesh.triangles) {
                const Vec3 a = body.mesh.positions[t.x], b = body.mesh.positions[t.y],
                           c = body.mesh.positions[t.z];
                ASSERT_GT(glm::dot(glm::cross(b - a, c - a), body.mesh.normals[t.x]), 0.0f);
            }
        }
    }
    EXPECT_THROW(makePrimitive("cone", 100, Vec3(1)), Error);
    EXPECT_THROW(makePrimitive("box", 0, Vec3(1)), Error);
}

TEST(ProceduralPrimitive, acceptsTheSmallestCounts) {
    for (const char* kind : {"sphere", "box", "plane", "torus"})
        expectSane(makePrimitive(kind, 1, Vec3(1)));
}

}  // namespace
}  // namespace stipple
