// SPDX-License-Identifier: Apache-2.0
// What saveGlb() writes, loadScene() must read again.
#include <scenegraph/io/gltf_writer.h>
#include <scenegraph/io/load.h>
#include <scenegraph/procedural/generators.h>

#include <gtest/gtest.h>

#include <filesystem>

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
        EXPECT_NEAR(scene.materials[i].shininess, expected.shininess, 1e-3f * expected.shininess);
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

}  // namespace
}  // namespace stipple
