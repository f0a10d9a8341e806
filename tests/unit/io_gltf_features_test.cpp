// SPDX-License-Identifier: Apache-2.0
// Poses, compression, points and further maps of glTF files.
#include <gtest/gtest.h>

#include <scenegraph/surface_at.h>

#include "io_gltf_samples.h"

#include <chrono>

namespace stipple {
namespace {

Loaded load(const GltfBuilder& builder) {
    GltfBuilder b = builder;
    Loaded loaded = tryLoadText("t.glb", b.glb());
    EXPECT_EQ(loaded.error, "");
    return loaded;
}

void expectNear(const Vec3& a, const Vec3& b, float tolerance = 1e-5f) {
    EXPECT_LT(glm::length(a - b), tolerance)
        << a.x << " " << a.y << " " << a.z << ", not " << b.x << " " << b.y << " " << b.z;
}

// The positions of the mesh's first triangle that lie nearest to the wanted ones.
void expectCorners(const Mesh& mesh, std::vector<Vec3> wanted) {
    ASSERT_EQ(mesh.positions.size(), wanted.size());
    for (size_t i = 0; i < wanted.size(); ++i) expectNear(mesh.positions[i], wanted[i]);
}

TEST(IoGltfFeatures, skinsAndMorphTargetsStandInTheirDefaultPose) {
    const Loaded loaded = load(skinnedTriangle());
    ASSERT_EQ(loaded.scene.meshes.size(), 1u);
    // Corner 0: 0.5 x the target's 2, then up by joint 0. The others: joint 1 is at (0,10,5), its
    // inverse bind matrix shifts by -1 in x. The skinned node's own place has no meaning.
    expectCorners(loaded.scene.meshes[0], {{0, 0, 6}, {0, 10, 5}, {-1, 11, 5}});
    EXPECT_TRUE(loaded.diagnostics.warnings.empty());
}

TEST(IoGltfFeatures, nodesOverrideTheMeshsMorphWeights) {
    GltfBuilder b = skinnedTriangle();
    b.json["nodes"][0].erase("skin");
    b.json["nodes"][0].erase("translation");
    b.json["nodes"].push_back({{"mesh", 0}, {"weights", {1.0}}});
    b.json["nodes"].push_back({{"mesh", 0}, {"weights", {0.0}}});
    b.json["scenes"][0]["nodes"] = {0, 3, 4};
    const Loaded loaded = load(b);
    ASSERT_EQ(loaded.scene.meshes.size(), 3u);
    for (const auto& [mesh, z] : {std::pair{0, 1.0f}, {1, 2.0f}, {2, 0.0f}})
        expectNear(loaded.scene.meshes[size_t(mesh)].positions[0], Vec3(0, 0, z));
}

TEST(IoGltfFeatures, refusesSkinsThatDoNotFit) {
    const auto errorWith = [](const auto& change) {
        GltfBuilder b = skinnedTriangle();
        change(b);
        return tryLoadText("t.glb", b.glb()).error;
    };
    EXPECT_EQ(errorWith([](GltfBuilder& b) { b.json["skins"][0]["joints"] = {1}; }),
              "t.glb: meshes[0].primitives[0].attributes.JOINTS_0: joint 1, but the skin has 1");
    EXPECT_EQ(errorWith([](GltfBuilder& b) { b.json["scenes"][0]["nodes"] = {0}; }),
              "t.glb: skins[0].joints[0]: is not in the scene that is shown");
    EXPECT_EQ(errorWith([](GltfBuilder& b) {
                  b.json["skins"][0]["joints"] = {1, 2, 1};
              }),
              "t.glb: skins[0].inverseBindMatrices: count 2 < the 3 joints");
}

TEST(IoGltfFeatures, decodesMeshoptBuffers) {
    const Loaded loaded = load(meshoptSquare());
    ASSERT_EQ(loaded.scene.meshes.size(), 1u);
    EXPECT_NEAR(loaded.scene.meshes[0].area, 1.0, 1e-6);
    EXPECT_EQ(sceneSize(loaded.scene).instances, 3);
    GltfBuilder greedy = meshoptSquare();
    greedy.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = 400000000;
    EXPECT_NE(tryLoadText("t.glb", greedy.glb()).error.find("too few bytes"), std::string::npos);
}

TEST(IoGltfFeatures, decodesDracoMeshes) {
    const Loaded loaded = load(dracoTriangle());
    const Mesh& mesh = loaded.scene.meshes.at(0);
    EXPECT_EQ(mesh.triangles.size(), 1u + 4u * 2u);
    Box3 box;
    for (int i = 0; i < 3; ++i) box.extend(mesh.positions[size_t(i)]);
    expectNear(box.min, Vec3(0, 0, 0), 1e-3f);
    expectNear(box.max, Vec3(1, 1, 0), 1e-3f);
    GltfBuilder wrong = dracoTriangle();
    wrong.json["accessors"][1]["count"] = 6;
    EXPECT_NE(tryLoadText("t.glb", wrong.glb()).error.find("holds 1 triangles, but"),
              std::string::npos);
}

TEST(IoGltfFeatures, pointsBecomeDoubleSidedDiscsOfTheirColours) {
    GltfBuilder b = dracoTriangle();
    b.json["meshes"][0]["primitives"].erase(0);
    const Loaded loaded = load(b);
    const Mesh& mesh = loaded.scene.meshes.at(0);
    EXPECT_EQ(mesh.triangles.size(), 8u);
    EXPECT_EQ(mesh.colors.at(0), Vec4(1, 0, 0, 1));
    EXPECT_EQ(mesh.colors.at(15), Vec4(1, 1, 1, 1));
    EXPECT_TRUE(loaded.scene.materials.at(mesh.triangle_material[0]).double_sided);
    // Four points of a square in the plane z = 1: discs in that plane, of the area of a circle
    // whose radius is the mean distance to the three others.
    for (const Vec3& p : mesh.positions) EXPECT_NEAR(p.z, 1.0f, 1e-4f);
    const double radius = (2.0 + std::sqrt(2.0)) / 3.0;
    EXPECT_NEAR(mesh.area, 4.0 * kPi * radius * radius, 1e-3);
}

TEST(IoGltfFeatures, normalMapsTurnTheShadingNormal) {
    GltfBuilder b = skinnedTriangle();
    b.json["nodes"] = {{{"mesh", 0}, {"weights", {0}}}};
    b.json["scenes"] = {{{"nodes", {0}}}};
    b.json.erase("skins");
    for (const bool stored : {false, true}) {
        if (stored) {
            // Turned by 90 degrees against what the uvs say.
            b.primitive()["attributes"]["TANGENT"] =
                b.addFloats({0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1}, "VEC4");
        }
        const Loaded loaded = load(b);
        const Scene& scene = loaded.scene;
        const Material& material = scene.materials.at(scene.meshes[0].triangle_material[0]);
        EXPECT_EQ(material.normal_map.uv_layer, 1);  // TEXCOORD_1
        EXPECT_FALSE(scene.textures.at(size_t(material.normal_map.texture)).srgb);
        EXPECT_TRUE(scene.textures.at(size_t(material.base_texture)).srgb);
        const auto normalAt = [&](float u, float v) {
            return surfaceAt(scene.meshes[0], scene.materials, scene.textures, 0, u, v, {})
                .normal_object;
        };
        // The left half of the map says +x, the right one +y, which is -v. TEXCOORD_1 reaches to
        // the middle only.
        const Vec3 n = normalAt(0.5f, 0.25f);
        expectNear(n, stored ? Vec3(0, 1, 0) : Vec3(1, 0, 0), 0.02f);
    }
}

TEST(IoGltfFeatures, theBitangentPointsUpInThePicture) {
    GltfBuilder b = skinnedTriangle();
    b.json["nodes"] = {{{"mesh", 0}, {"weights", {0}}}};
    b.json["scenes"] = {{{"nodes", {0}}}};
    b.json.erase("skins");
    const std::string png = pngBytes({128, 255, 128}, 3);
    b.json["images"][0]["bufferView"] = b.addView<char>({png.begin(), png.end()});
    // The picture's columns run along x, its rows down along -y: up is +y.
    const Loaded loaded = load(b);
    const Scene& scene = loaded.scene;
    expectNear(surfaceAt(scene.meshes[0], scene.materials, scene.textures, 0, 0.2f, 0.2f, {})
                   .normal_object,
               Vec3(0, 1, 0), 0.02f);
    // Mirrored uvs: the tangent turns round, up stays.
    b.primitive()["attributes"]["TEXCOORD_1"] = b.addFloats({1, 1, 0, 1, 1, 0}, "VEC2");
    const Loaded mirrored = load(b);
    expectNear(surfaceAt(mirrored.scene.meshes[0], mirrored.scene.materials,
                         mirrored.scene.textures, 0, 0.2f, 0.2f, {})
                   .normal_object,
               Vec3(0, 1, 0), 0.02f);
}

TEST(IoGltfFeatures, specularExtensionScalesWhatIsMirrored) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["material"] = 0;
    b.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}}},
                            {"extensions",
                             {{"KHR_materials_specular",
                               {{"specularFactor", 0.5}, {"specularColorFactor", {1, 2, 0}}}}}}}};
    const Loaded loaded = load(b);
    const SurfaceFinish finish = plainFinish(loaded.scene.materials.at(0));
    expectNear(finish.specular, Vec3(0.02f, 0.04f, 0.0f));
    EXPECT_EQ(finish.specular_edge, 0.5f);
}

TEST(IoGltfFeatures, specularTexturesVaryOverTheSurface) {
    GltfBuilder b = skinnedTriangle();
    const std::string png = pngBytes({255, 0, 0, 255, 255, 255, 255, 51});
    b.json["images"][0]["bufferView"] = b.addView<char>({png.begin(), png.end()});
    b.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}}},
                            {"extensions",
                             {{"KHR_materials_specular",
                               {{"specularTexture", {{"index", 0}}},
                                {"specularColorFactor", {10, 10, 10}},
                                {"specularColorTexture", {{"index", 0}}}}}}}}};
    const Loaded loaded = load(b);
    const auto finishAt = [&](float u) {
        return surfaceAt(loaded.scene.meshes[0], loaded.scene.materials, loaded.scene.textures, 0,
                         u, 0, {})
            .finish;
    };
    expectNear(finishAt(0.25f).specular, Vec3(0.4f, 0, 0), 1e-4f);
    EXPECT_NEAR(finishAt(0.25f).specular_edge, 1.0f, 1e-5f);
    expectNear(finishAt(0.75f).specular, Vec3(0.08f), 1e-4f);
    EXPECT_NEAR(finishAt(0.75f).specular_edge, 0.2f, 1e-5f);
}

TEST(IoGltfFeatures, aMillionInstancesLoadInSeconds) {
    constexpr int kCount = 1000000;
    GltfBuilder b = GltfBuilder::triangle();
    std::vector<float> translations;
    for (int i = 0; i < kCount; ++i) {
        for (const int v : {i % 1000, 0, i / 1000}) translations.push_back(float(v));
    }
    b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
        b.addFloats(translations, "VEC3");
    const TempFolder folder;
    const std::string path = folder.write("t.glb", b.glb());
    const auto start = std::chrono::steady_clock::now();
    const Loaded loaded = tryLoad(path);
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    ASSERT_EQ(loaded.error, "");
    EXPECT_EQ(sceneSize(loaded.scene).instances, kCount);
    RecordProperty("seconds", std::to_string(seconds));
    EXPECT_LT(seconds, 20.0);  // 1 s where nothing else runs
}

TEST(IoGltfFeatures, aFileThatShowsNothingIsAnEmptySceneWithAWarning) {
    const Loaded loaded = tryLoadText("t.gltf", R"({"asset": {"version": "2.0"}})");
    EXPECT_EQ(loaded.error, "");
    ASSERT_EQ(loaded.diagnostics.warnings.size(), 1u);
    EXPECT_NE(loaded.diagnostics.warnings[0].find("the scene is empty"), std::string::npos);
}

}  // namespace
}  // namespace stipple
