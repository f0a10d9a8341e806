// SPDX-License-Identifier: Apache-2.0
// What saveGlb() writes, loadScene() must read again.
#include <scenegraph/io/gltf_writer.h>
#include <scenegraph/io/load.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/surface_at.h>

#include <core/rng.h>
#include <render/compare.h>
#include <render/renderer.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cstring>
#include <filesystem>
#include <fstream>

namespace stipple {
namespace {

class IoGltfWriter : public testing::Test {
protected:
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        folder_ = std::filesystem::path(testing::TempDir()) /
                  (std::string("stipple_gltf_writer_") + info->name());
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

private:
    std::filesystem::path folder_;
};

TEST_F(IoGltfWriter, treeComesBackAsItWas) {
    TreeParams params;
    params.triangles = 2000;
    const GeneratedMesh tree = makeTree(params);
    saveGlb(path("tree.glb"), tree.mesh, tree.materials);
    ThreadPool pool(1);
    Diagnostics diagnostics;
    const Scene scene = loadScene(path("tree.glb"), {}, pool, diagnostics);

    ASSERT_EQ(scene.meshes.size(), 1u);
    const Mesh& mesh = scene.meshes[0];
    EXPECT_EQ(mesh.name, tree.mesh.name);
    Mesh built = tree.mesh;
    buildMesh(built, tree.materials, "tree");
    EXPECT_EQ(mesh.triangles.size(), built.triangles.size());
    EXPECT_NEAR(mesh.area, built.area, 1e-4 * built.area);
    EXPECT_EQ(mesh.bounds.min, built.bounds.min);
    EXPECT_EQ(mesh.bounds.max, built.bounds.max);
    ASSERT_EQ(mesh.normals.empty(), tree.mesh.normals.empty());
    ASSERT_EQ(mesh.colors.empty(), tree.mesh.colors.empty());

    ASSERT_EQ(scene.materials.size(), tree.materials.size());
    for (size_t i = 0; i < tree.materials.size(); ++i) {
        const Material& expected = tree.materials[i];
        EXPECT_EQ(scene.materials[i].name, expected.name);
        EXPECT_EQ(scene.materials[i].double_sided, expected.double_sided);
        EXPECT_NEAR(scene.materials[i].roughness, expected.roughness, 1e-6f);
        EXPECT_NEAR(scene.materials[i].specular.g, expected.specular.g, 1e-6f);
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(scene.materials[i].base_color[c], expected.base_color[c], 1e-6f);
    }
}

TEST_F(IoGltfWriter, refusesAnEmptyMeshAndAMissingFolder) {
    EXPECT_THROW(saveGlb(path("empty.glb"), Mesh(), {}), Error);
    EXPECT_FALSE(std::filesystem::exists(path("empty.glb")));
    const GeneratedMesh box = makePrimitive("box", 12, Vec3(0.5f));
    EXPECT_THROW(saveGlb(path("missing/box.glb"), box.mesh, box.materials), Error);
}

// Two kinds in nested groups: turned, mirrored, stretched, sheared; textured; lights of all kinds.
Scene nestedScene() {
    Scene scene;
    scene.path = "test";
    for (const char* kind : {"sphere", "box"}) {
        GeneratedMesh made = makePrimitive(kind, 300, Vec3(0.8f, 0.6f, 0.3f));
        for (uint16_t& m : made.mesh.triangle_material) m = uint16_t(scene.materials.size());
        // Rough and with glTF's own reflectance: what the loader takes for a default.
        made.materials[0].specular = Vec3(0.04f);
        for (const Vec3& p : made.mesh.positions) made.mesh.uvs.push_back(Vec2(p.x, p.y));
        scene.materials.push_back(made.materials[0]);
        scene.meshes.push_back(std::move(made.mesh));
    }
    Texture texture;
    texture.wrap_u = Wrap::kMirror;
    texture.levels.push_back({2, 1, {255, 128, 0, 255, 30, 200, 90, 255}});
    buildMipmaps(texture);
    scene.textures.push_back(texture);
    scene.materials[1].base_texture = 0;
    Group pair, root;
    pair.name = "pair", root.name = "root";
    pair.instances.add(ChildRef::mesh(0), {DMat3(0.8), DVec3(-0.5, 0, 0)});
    pair.instances.add(ChildRef::mesh(1),
                       {DMat3(0.5, 0.2, 0, 0, 0.7, 0, 0, 0, 0.4), DVec3(0.6, 0.1, 0)});
    root.instances = InstanceStore(DBox3{DVec3(-20), DVec3(20)});
    Rng rng{5};
    for (int i = 0; i < 60; ++i) {
        const double angle = rng.uniform(0.0, 6.0), c = std::cos(angle), s = std::sin(angle);
        const DMat3 turn(c, 0, -s, 0, 1, 0, s, 0, c);
        const DMat3 scale = i % 3 == 0   ? DMat3(1.3)
                            : i % 3 == 1 ? DMat3(-1, 0, 0, 0, 1, 0, 0, 0, 1)
                                         : DMat3(1, 0, 0, 0, 2, 0, 0, 0, 0.7);
        root.instances.add(
            ChildRef::group(0),
            {turn * scale, DVec3(rng.uniform(-8, 8), rng.uniform(-4, 4), rng.uniform(-8, 8))});
    }
    scene.groups.push_back(std::move(pair));
    scene.groups.push_back(std::move(root));
    scene.root = 1;
    scene.cameras.push_back(lookAt(DVec3(3, 6, 22), DVec3(0, 0, 0)));
    scene.cameras[0].name = "eye";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.2f, 0.9f, 0.4f)), Vec3(2.0f, 1.5f, 1.0f)});
    PointLight lamp;
    lamp.position = DVec3(1, 5, 3);
    lamp.intensity = Vec3(20, 30, 10);
    lamp.range = 50.0f;
    scene.lighting.points.push_back(lamp);
    lamp.is_spot = true;
    lamp.axis = glm::normalize(Vec3(0.3f, -1.0f, -0.5f));
    lamp.inner_cone = 0.3f, lamp.outer_cone = 0.9f;
    scene.lighting.points.push_back(lamp);
    ThreadPool pool(1);
    buildScene(scene, pool);
    return scene;
}

TEST_F(IoGltfWriter, aSceneReadBackRendersTheSamePicture) {
    const Scene scene = nestedScene();
    ThreadPool pool(2);
    FrameRequest request;
    request.camera = scene.cameras[0];
    request.settings.width = 160, request.settings.height = 120;
    request.settings.method = Method::kRaycast;
    request.settings.samples = 4;
    const Image expected = Renderer(scene, pool).render(request).image;
    for (const char* name : {"scene.glb", "scene.gltf"}) {
        saveSceneGltf(path(name), scene);
        Diagnostics diagnostics;
        const Scene again = loadScene(path(name), {}, pool, diagnostics);
        EXPECT_EQ(sceneSize(again).instances, 120.0);
        EXPECT_EQ(sceneSize(again).triangles_total, sceneSize(scene).triangles_total);
        EXPECT_EQ(again.textures.size(), 1u);
        ASSERT_EQ(again.lighting.suns.size(), 1u);
        ASSERT_EQ(again.lighting.points.size(), 2u);
        EXPECT_NEAR(again.lighting.points[1].outer_cone, 0.9f, 1e-6f);
        EXPECT_LT(glm::length(again.lighting.points[1].axis - scene.lighting.points[1].axis),
                  1e-5f);
        const Camera* eye = again.findCamera("eye");
        ASSERT_TRUE(eye);
        EXPECT_LT(glm::length(eye->eye - DVec3(3, 6, 22)), 1e-6);
        request.camera = *eye;
        const Image picture = Renderer(again, pool).render(request).image;
        EXPECT_GT(compareImages(picture, expected, pool).psnr, 45.0) << name;
    }
}

TEST_F(IoGltfWriter, refusesMoreInstancesThanItCanFlatten) {
    Scene scene;
    scene.path = "test";
    GeneratedMesh box = makePrimitive("box", 12, Vec3(0.5f));
    scene.materials = box.materials;
    scene.meshes.push_back(box.mesh);
    ChildRef child = ChildRef::mesh(0);
    for (int level = 0; level < 8; ++level) {
        Group group;
        for (int i = 0; i < 10; ++i) group.instances.add(child, {DMat3(1.0), DVec3(i, level, 0)});
        child = ChildRef::group(uint32_t(scene.groups.size()));
        scene.groups.push_back(std::move(group));
    }
    scene.root = child.index();
    ThreadPool pool(1);
    buildScene(scene, pool);
    try {
        saveSceneGltf(path("big.glb"), scene);
        FAIL() << "10^8 instances were written";
    } catch (const Error& e) {
        EXPECT_EQ(e.code(), ErrorCode::kUnsupported);
        EXPECT_NE(std::string(e.what()).find("1e+08 instances"), std::string::npos) << e.what();
    }
    EXPECT_FALSE(std::filesystem::exists(path("big.glb")));
}

// What the glTF 2.0 specification asks of accessors, buffer views and normals.
void expectValidGlb(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), {});
    const auto word = [&](size_t at) {
        uint32_t w;
        std::memcpy(&w, bytes.data() + at, 4);
        return w;
    };
    ASSERT_EQ(bytes.substr(0, 4), "glTF");
    ASSERT_EQ(word(8), bytes.size());
    const nlohmann::json json = nlohmann::json::parse(bytes.substr(20, word(12)));
    const std::string bin = bytes.substr(20 + word(12) + 8);
    ASSERT_EQ(json["buffers"].size(), 1u);
    EXPECT_LE(size_t(json["buffers"][0]["byteLength"]), bin.size());
    const auto floats = [&](int accessor, int n) {
        const auto& a = json["accessors"][accessor];
        const auto& view = json["bufferViews"][int(a["bufferView"])];
        EXPECT_EQ(view.value("byteOffset", size_t(0)) % 4, 0u);
        const size_t count = a["count"];
        std::vector<float> values(count * size_t(n));
        EXPECT_EQ(values.size() * 4, size_t(view["byteLength"]));
        std::memcpy(values.data(), bin.data() + view.value("byteOffset", size_t(0)),
                    values.size() * 4);
        return values;
    };
    for (const auto& view : json["bufferViews"])
        EXPECT_LE(view.value("byteOffset", size_t(0)) + size_t(view["byteLength"]), bin.size());
    for (const auto& mesh : json["meshes"]) {
        for (const auto& primitive : mesh["primitives"]) {
            const int position = primitive["attributes"]["POSITION"];
            const std::vector<float> p = floats(position, 3);
            for (int c = 0; c < 3; ++c) {
                float low = p[c], high = p[c];
                for (size_t i = c; i < p.size(); i += 3)
                    low = std::min(low, p[i]), high = std::max(high, p[i]);
                EXPECT_EQ(float(json["accessors"][position]["min"][c]), low);
                EXPECT_EQ(float(json["accessors"][position]["max"][c]), high);
            }
            const auto& view = json["bufferViews"][int(json["accessors"][position]["bufferView"])];
            EXPECT_EQ(view["target"], 34962);
            if (primitive["attributes"].contains("NORMAL")) {
                const std::vector<float> n = floats(primitive["attributes"]["NORMAL"], 3);
                EXPECT_EQ(n.size(), p.size());
                for (size_t i = 0; i < n.size(); i += 3) {
                    ASSERT_NEAR(glm::length(Vec3(n[i], n[i + 1], n[i + 2])), 1.0f, 5e-4f);
                }
            }
            const auto& indices = json["accessors"][int(primitive["indices"])];
            const auto& index_view = json["bufferViews"][int(indices["bufferView"])];
            EXPECT_EQ(index_view["target"], 34963);
            ASSERT_EQ(indices["componentType"], 5125);
            ASSERT_EQ(int(indices["count"]) % 3, 0);
            for (size_t i = 0; i < size_t(indices["count"]); i += 3) {
                UVec3 t;
                std::memcpy(&t, bin.data() + index_view.value("byteOffset", size_t(0)) + i * 4, 12);
                ASSERT_TRUE(t.x < p.size() / 3 && t.y < p.size() / 3 && t.z < p.size() / 3);
                ASSERT_TRUE(t.x != t.y && t.y != t.z && t.x != t.z);
            }
        }
    }
    for (const auto& material : json["materials"]) {
        EXPECT_EQ(material.contains("alphaCutoff"),
                  material.value("alphaMode", "") == "MASK" && material.contains("alphaCutoff"));
        for (const auto& [name, unused] : material["extensions"].items()) {
            const auto& used = json["extensionsUsed"];
            EXPECT_NE(std::find(used.begin(), used.end(), name), used.end()) << name;
        }
        for (const auto& x : material.value("emissiveFactor", std::vector<double>()))
            EXPECT_LE(x, 1.0);
    }
}

TEST_F(IoGltfWriter, keepsEveryTextureOfAMaterial) {
    Scene scene = nestedScene();
    Material& m = scene.materials[1];
    m.metallic = 0.5f, m.roughness = 0.25f, m.specular = Vec3(0.02f, 0.04f, 0.08f);
    m.specular_weight = 0.75f, m.normal_scale = 0.5f, m.emissive = Vec3(3, 2, 1);
    scene.textures.push_back(scene.textures[0]);
    scene.textures[1].srgb = false;  // as glTF has it for all that is no colour
    m.normal_map = m.metallic_roughness_map = {1, 0};
    m.specular_map = {1, 1};
    m.emissive_map = {0, 0};
    m.specular_color_map = {0, 1};
    Mesh& mesh = scene.meshes[1];
    mesh.more_uvs.push_back(mesh.uvs);
    for (Vec2& uv : mesh.more_uvs[0]) uv = 3.0f * uv + 0.5f;
    saveSceneGltf(path("all.glb"), scene);
    expectValidGlb(path("all.glb"));
    ThreadPool pool(1);
    Diagnostics diagnostics;
    const Scene loaded = loadScene(path("all.glb"), {}, pool, diagnostics);
    EXPECT_TRUE(diagnostics.warnings.empty());
    const Mesh* found = nullptr;
    for (const Mesh& candidate : loaded.meshes) {
        if (candidate.triangles.size() == mesh.triangles.size()) found = &candidate;
    }
    ASSERT_TRUE(found);
    // Triangles keep their order only up to the build's sorting: compare the sums.
    const auto sumOf = [](const Scene& from, const Mesh& at) {
        Vec4 sum(0.0f);
        for (uint32_t t = 0; t < at.triangles.size(); ++t) {
            const SurfaceFinish finish =
                surfaceAt(at, from.materials, from.textures, t, 0.3f, 0.3f, {}).finish;
            sum += Vec4(finish.roughness, finish.metallic, finish.specular.b + finish.specular_edge,
                        finish.emissive.g);
        }
        return sum;
    };
    const Vec4 expected = sumOf(scene, mesh), sums = sumOf(loaded, *found);
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(sums[c], expected[c], 1e-3f * expected[c]) << c;
}

TEST_F(IoGltfWriter, filesKeepToTheRulesOfGltf) {
    const GeneratedMesh models[] = {makeTree({.triangles = 3000}), makeGrass({}), makeRock({}),
                                    makeTerrain({}, makeHeightField({.resolution = 33}))};
    for (const GeneratedMesh& model : models) {
        SCOPED_TRACE(model.mesh.name);
        saveGlb(path("model.glb"), model.mesh, model.materials);
        expectValidGlb(path("model.glb"));
    }
    saveSceneGltf(path("scene.glb"), nestedScene());
    expectValidGlb(path("scene.glb"));
}

}  // namespace
}  // namespace stipple
