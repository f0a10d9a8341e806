// SPDX-License-Identifier: Apache-2.0
// Hybrid models: the surface covered by surfels at every level, levels nested, borders kept by
// simplification, files that come back and damaged ones refused.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/io/edges.h>
#include <scenegraph/io/hybrid.h>
#include <scenegraph/io/hybrid_file.h>
#include <scenegraph/io/surfel_file.h>
#include <scenegraph/procedural/generators.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <set>

namespace stipple {
namespace {

Scene sceneOf(GeneratedMesh made) {
    Scene scene;
    scene.path = "test";
    scene.materials = made.materials;
    scene.textures = made.textures;
    scene.meshes.push_back(std::move(made.mesh));
    Group group;
    group.instances.add(ChildRef::mesh(0), Affine());
    scene.groups.push_back(std::move(group));
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

HybridModel build(const Scene& scene, const HybridOptions& options, int threads = 2) {
    ThreadPool pool(threads);
    const CancelFlag cancel;
    HybridReport report;
    return buildHybrid(
        scene, options, pool, cancel, [](const char*, double) {}, report);
}

GeneratedMesh torus(int triangles) {
    return makePrimitive("torus", triangles, Vec3(0.8f, 0.5f, 0.3f));
}

std::vector<Vec3> positionsOf(const SurfelLevel& level) {
    std::vector<Vec3> positions;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i)
            positions.push_back(unpackSurfel(level, block, i).position);
    }
    return positions;
}

float distanceTo(const std::vector<Vec3>& points, const Vec3& p) {
    float least = kInfinity;
    for (const Vec3& q : points) least = std::min(least, glm::length(p - q));
    return least;
}

// Places spread over the triangles of the model.
std::vector<Vec3> placesOn(const HybridModel& model, int n) {
    Rng rng{7};
    std::vector<Vec3> places;
    for (int i = 0; i < n; ++i) {
        const size_t t = size_t(rng.uniform(0, double(model.triangles.size())));
        float u = float(rng.uniform(0, 1)), v = float(rng.uniform(0, 1));
        if (u + v > 1.0f) u = 1.0f - u, v = 1.0f - v;
        const UVec3& c = model.triangles[t];
        places.push_back(model.mesh.positions[c.x] * (1 - u - v) + model.mesh.positions[c.y] * u +
                         model.mesh.positions[c.z] * v);
    }
    return places;
}

// Next to no area, but long borders.
TEST(Hybrid, samplesOfBordersCountAgainstTheMemory) {
    GeneratedMesh needles;
    for (uint32_t i = 0; i < 100; ++i) {
        const float x = 0.01f * float(i);
        needles.mesh.positions.insert(needles.mesh.positions.end(),
                                      {Vec3(x, 0, 0), Vec3(x, 1, 0), Vec3(x + 1e-5f, 0, 0)});
        needles.mesh.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
        needles.mesh.triangle_material.push_back(0);
    }
    needles.materials.emplace_back();
    const Scene scene = sceneOf(std::move(needles));
    HybridOptions options;
    options.spacing = 0.02;
    options.memory_limit_mb = 50;
    try {
        build(scene, options);
        ADD_FAILURE() << "some 700 000 samples were taken in 50 MB";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory) << error.what();
    }
    options.spacing = 1.0;
    EXPECT_FALSE(build(scene, options).patches.empty());
}

TEST(Hybrid, surfelsCoverTheSurfaceAtEveryLevel) {
    for (const char* kind : {"torus", "sphere", "box"}) {
        const HybridModel model =
            build(sceneOf(makePrimitive(kind, 6000, Vec3(0.5f))), HybridOptions());
        const std::vector<Vec3> places = placesOn(model, 1000);
        for (size_t l = 0; l < 5; ++l) {
            std::vector<Vec3> points;
            float spacing = 0.0f;
            // Of discs, which are drawn of the finest level alone.
            const float reach = l == 0 ? 0.5f * kGridDiscSide : 1.25f;
            for (const HybridPatch& patch : model.patches) {
                const SurfelLevel& level = patch.surfels[std::min(l, patch.surfels.size() - 1)];
                const std::vector<Vec3> some = positionsOf(level);
                points.insert(points.end(), some.begin(), some.end());
                spacing = std::max(spacing, level.spacing);
            }
            for (const Vec3& p : places)
                EXPECT_LE(distanceTo(points, p), reach * spacing) << kind << l;
        }
    }
}

TEST(Hybrid, levelsAreNestedAndEachHasAboutHalf) {
    const HybridModel model = build(sceneOf(torus(4000)), HybridOptions());
    for (const HybridPatch& patch : model.patches) {
        ASSERT_GE(patch.surfels.size(), 3u);
        for (size_t l = 1; l < patch.surfels.size(); ++l) {
            const SurfelLevel &fine = patch.surfels[l - 1], &coarse = patch.surfels[l];
            EXPECT_NEAR(double(coarse.size()) / double(fine.size()), 0.55, 0.2);
            EXPECT_NEAR(coarse.spacing / fine.spacing, std::sqrt(2.0), 1e-3);
            const std::vector<Vec3> all = positionsOf(fine);
            // Both are rounded, each to a step of its own blocks.
            for (const Vec3& p : positionsOf(coarse))
                EXPECT_LE(distanceTo(all, p), 0.03f * coarse.spacing);
        }
    }
}

// Edges of which a level has one triangle alone.
std::set<std::pair<uint32_t, uint32_t>> borderOf(const HybridModel& model,
                                                 const TriangleLevel& level) {
    Mesh mesh;
    mesh.positions = model.mesh.positions;
    mesh.triangles = level.triangles;
    std::set<std::pair<uint32_t, uint32_t>> border;
    for (const SharedEdge& e : sharedEdges(mesh)) {
        if (e.b == kNoTriangle) border.emplace(e.from, e.to);
    }
    return border;
}

TEST(Hybrid, simplifiedPatchesKeepTheirBorders) {
    HybridOptions options;
    options.keep = PatchKind::kTriangles;
    const HybridModel model = build(sceneOf(torus(8000)), options);
    size_t levels = 0, triangles = 0;
    for (const HybridPatch& patch : model.patches) {
        EXPECT_TRUE(patch.surfels.empty());
        triangles += patch.triangles[0].triangles.size();
        for (size_t l = 1; l < patch.triangles.size(); ++l, ++levels) {
            EXPECT_LT(patch.triangles[l].triangles.size(), patch.triangles[l - 1].triangles.size());
            EXPECT_GE(patch.triangles[l].error, patch.triangles[l - 1].error);
            EXPECT_EQ(borderOf(model, patch.triangles[l]), borderOf(model, patch.triangles[0]));
        }
    }
    EXPECT_EQ(triangles, model.triangles.size());
    EXPECT_GE(levels, model.patches.size());
}

TEST(Hybrid, flatnessDecidesWhatIsKeptWhereAsked) {
    HybridOptions options;
    options.keep = PatchKind::kByFlatness;
    options.clusters.phase_two = 10.0;
    options.clusters.flat_share = 0.5;
    const HybridModel model = build(sceneOf(torus(8000)), options);
    size_t flat = 0, other = 0;
    for (const HybridPatch& patch : model.patches) {
        EXPECT_NE(patch.triangles.empty(), patch.surfels.empty());
        ++(patch.surfels.empty() ? flat : other);
    }
    EXPECT_GT(flat, 0u);
    EXPECT_GT(other, 0u);
}

TEST(Hybrid, sameModelForAnyThreads) {
    const Scene scene = sceneOf(torus(5000));
    EXPECT_EQ(hybridFileText(build(scene, HybridOptions(), 1)),
              hybridFileText(build(scene, HybridOptions(), 3)));
}

TEST(Hybrid, paintedClustersHaveOneColourEach) {
    HybridOptions options;
    options.paint_clusters = true;
    const HybridModel model = build(sceneOf(torus(3000)), options);
    ASSERT_EQ(model.mesh.colors.size(), model.mesh.positions.size());
    for (const UVec3& t : model.triangles) {
        EXPECT_EQ(model.mesh.colors[t.x], model.mesh.colors[t.y]);
        EXPECT_EQ(model.mesh.colors[t.x], model.mesh.colors[t.z]);
    }
}

TEST(Hybrid, nothingToBuildOfIsRefused) {
    Scene scene;
    scene.path = "empty";
    scene.groups.emplace_back();
    ThreadPool pool(1);
    buildScene(scene, pool);
    EXPECT_THROW(build(scene, HybridOptions()), Error);
    HybridOptions options;
    EXPECT_THROW(applyOption(options, "phase_one", "much"), Error);
    EXPECT_THROW(applyOption(options, "keep", "some"), Error);
    EXPECT_THROW(applyOption(options, "resolution", "3"), Error);
}

TEST(HybridFile, comesBackAsItWas) {
    const HybridModel model = build(sceneOf(makeRock({})), HybridOptions());
    const std::string text = hybridFileText(model);
    MemoryBudget budget(0);
    const HybridModel read = parseHybridFile(text, budget, "rock.stipple");
    EXPECT_EQ(hybridFileText(read), text);
    EXPECT_EQ(read.triangles.size(), model.triangles.size());
    EXPECT_EQ(read.textures.size(), model.textures.size());
}

std::string errorOf(const std::string& text, uint64_t limit_mb = 0) {
    MemoryBudget budget(limit_mb);
    try {
        HybridModel model = parseHybridFile(text, budget, "m.stipple");
        // What passes can be shown.
        Scene scene;
        scene.groups.emplace_back();
        scene.groups[0].instances.add(addHybridModel(scene, std::move(model), "m.stipple"),
                                      Affine());
        ThreadPool pool(1);
        buildScene(scene, pool);
    } catch (const Error& error) {
        EXPECT_NE(error.code(), ErrorCode::kInternal);
        return error.what();
    }
    return "";
}

// The checksum made to fit, so that what lies behind it is tried, too.
std::string withChecksum(std::string text) {
    constexpr size_t kHeader = 32;
    uint64_t key = text.size() - kHeader;
    for (size_t i = kHeader; i < text.size(); i += 8) {
        uint64_t word = 0;
        std::memcpy(&word, text.data() + i, std::min<size_t>(8, text.size() - i));
        key = hashCombine(key, word);
    }
    std::memcpy(text.data() + 24, &key, 8);
    const uint64_t size = text.size() - kHeader;
    std::memcpy(text.data() + 16, &size, 8);
    return text;
}

TEST(HybridFile, refusesWhatIsDamaged) {
    const std::string text = hybridFileText(build(sceneOf(torus(300)), HybridOptions()));
    EXPECT_EQ(errorOf(text), "");
    EXPECT_EQ(withChecksum(text), text);
    for (size_t n = 0; n < text.size(); n += 97) EXPECT_NE(errorOf(text.substr(0, n)), "") << n;
    Rng rng{11};
    for (int i = 0; i < 100; ++i) {
        std::string flipped = text;
        flipped[size_t(rng.uniform(0, double(text.size())))] ^= char(1 << int(rng.uniform(0, 8)));
        EXPECT_NE(errorOf(flipped), "");
    }
    // Behind a checksum that fits anything may stand: an error or a model, but no crash.
    for (int i = 0; i < 1000; ++i) {
        std::string forged = text;
        for (int k = 0; k < 3; ++k)
            forged[32 + size_t(rng.uniform(0, double(i % 2 ? 400 : text.size() - 32)))] =
                char(rng.next());
        errorOf(withChecksum(forged));
        errorOf(
            withChecksum(forged.substr(0, 32 + size_t(rng.uniform(0, double(text.size() - 32))))));
    }
    HybridModel shorter = build(sceneOf(torus(300)), HybridOptions());
    shorter.mesh.normals.pop_back();
    EXPECT_NE(errorOf(hybridFileText(shorter)).find("arrays of different lengths"),
              std::string::npos);
    std::string newer = text;
    newer[8] = 9;
    EXPECT_NE(errorOf(newer).find("has version 9"), std::string::npos);
}

TEST(HybridFile, namesHaveNoControlCharacters) {
    HybridModel model = build(sceneOf(makeRock({})), HybridOptions());
    model.textures.resize(1);
    model.textures[0].levels.push_back({1, 1, std::vector<uint8_t>(4)});
    model.source = model.materials[0].name = model.textures[0].name = "a\x1b[2J\n";
    MemoryBudget budget(0);
    const HybridModel read = parseHybridFile(hybridFileText(model), budget, "rock.stipple");
    for (const std::string& name : {read.source, read.materials[0].name, read.textures[0].name}) {
        EXPECT_EQ(name[0], 'a');
        for (const char c : name) EXPECT_GE(c, ' ');
    }
}

// Each patch is a mesh with its own copies of vertices and finishes.
TEST(HybridFile, memoryIsReservedForWhatPatchesBecome) {
    HybridModel model = build(sceneOf(torus(300)), HybridOptions());
    HybridModel layers = model;
    layers.mesh.more_uvs.resize(8);
    EXPECT_EQ(errorOf(hybridFileText(layers), 5), "");
    layers.mesh.more_uvs.resize(9);
    EXPECT_NE(errorOf(hybridFileText(layers)).find("more than 8 further layers"),
              std::string::npos);

    HybridModel small = model;  // of one triangle each
    HybridPatch patch;
    patch.triangles.push_back({0.0f, {small.triangles[0]}, {small.triangle_material[0]}});
    small.patches.assign(20000, patch);
    ASSERT_LT(hybridFileText(small).size(), 2000000u);
    EXPECT_NE(errorOf(hybridFileText(small), 10).find("20000 patches need about"),
              std::string::npos);
    EXPECT_EQ(errorOf(hybridFileText(small), 40), "");

    HybridModel finishes = model;
    finishes.finishes.resize(256, finishes.finishes[0]);
    patch.triangles.clear();
    patch.surfels = {model.patches[0].surfels.back()};
    finishes.patches.assign(1000, patch);
    EXPECT_NE(errorOf(hybridFileText(finishes), 20).find("1000 patches need about"),
              std::string::npos);
}

}  // namespace
}  // namespace stipple
