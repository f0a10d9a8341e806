// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "io_gltf_samples.h"

namespace stipple {
namespace {

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(IoObj, readsPolygonsWithTheirAttributes) {
    const Loaded loaded =
        tryLoadText("t.obj", "# a comment\no square\n" + kSquare +
                                 "vt 0 0\nvt 1 0 0\nvt 1 1\nvt 0 1\nvn 0 0 2\ns off\n"
                                 "f 1/1/1 2/2/1 \\\r\n 3/3/1 -1/-1/-1\nf 1 2 3\n");
    ASSERT_EQ(loaded.error, "");
    const Mesh& mesh = loaded.scene.meshes.at(0);
    EXPECT_EQ(mesh.triangles.size(), 3u);
    EXPECT_NEAR(mesh.area, 1.5, 1e-6);
    ASSERT_EQ(mesh.positions.size(),
              7u);                       // corners without uv and normal are vertices of their own
    EXPECT_EQ(mesh.uvs[0], Vec2(0, 1));  // v points down here
    EXPECT_EQ(mesh.normals[0], Vec3(0, 0, 1));
    EXPECT_EQ(mesh.normals[6], Vec3(0));  // flat
    EXPECT_TRUE(loaded.scene.materials.at(0).double_sided);
    EXPECT_TRUE(loaded.diagnostics.warnings.empty());
}

TEST(IoObj, readsMaterialsTexturesAndOpacities) {
    const TempFolder folder;
    folder.write("maps/color map.png", pngBytes({255, 0, 0, 255, 0, 255, 0, 255}));
    folder.write("maps/alpha.png", pngBytes({0, 255}, 1));
    folder.write("my materials.mtl",
                 "newmtl leaf\nKd 1 1 1\nmap_Kd maps\\color map.png\nmap_d maps/alpha.png\n"
                 "newmtl glass\nKd 0.5 0 0\nd 0.25\nKs 1 1 1\nNs 8\nmap_Kd missing.png\n");
    const Loaded loaded =
        tryLoad(folder.write("t.obj", "mtllib my materials.mtl\n" + kSquare +
                                          "vt 0 0\nusemtl leaf\nf 1/1 2/1 3/1\nusemtl glass\nf 1 3 "
                                          "4\nusemtl lost\nf 1 2 4\n"));
    ASSERT_EQ(loaded.error, "");
    const auto& materials = loaded.scene.materials;
    ASSERT_EQ(materials.size(), 3u);  // the default one, then by name
    EXPECT_EQ(materials[1].name, "glass");
    EXPECT_EQ(materials[1].alpha_mode, AlphaMode::kBlend);
    EXPECT_EQ(materials[1].alpha, 0.25f);
    EXPECT_NEAR(materials[1].base_color.r, 0.2140f, 1e-3f);  // 0.5 in sRGB
    EXPECT_NEAR(materials[1].specular.r, 0.8f, 1e-5f);
    EXPECT_NEAR(materials[1].roughness, std::pow(0.2f, 0.25f), 1e-5f);
    EXPECT_EQ(materials[1].base_texture, kNoTexture);
    EXPECT_EQ(materials[2].alpha_mode, AlphaMode::kBlend);
    const Texture& leaf = loaded.scene.textures.at(size_t(materials[2].base_texture));
    EXPECT_EQ(sampleTexture(leaf, Vec2(0.25f, 0.5f), 0.0f).a, 0.0f);
    EXPECT_EQ(sampleTexture(leaf, Vec2(0.75f, 0.5f), 0.0f).a, 1.0f);
    EXPECT_EQ(sampleTexture(leaf, Vec2(0.75f, 0.5f), 0.0f).g, 1.0f);
    EXPECT_EQ(loaded.diagnostics.warnings.size(), 2u);  // missing.png; "lost"
}

TEST(IoObj, aMissingLibraryIsAWarningAndOneOutsideTheFolderAnError) {
    const Loaded missing = tryLoadText("t.obj", "mtllib none.mtl\n" + kSquare + "f 1 2 3\n");
    EXPECT_EQ(missing.error, "");
    ASSERT_EQ(missing.diagnostics.warnings.size(), 1u);
    EXPECT_NE(missing.diagnostics.warnings[0].find("MTL file \"none.mtl\""), std::string::npos);
    const Loaded outside =
        tryLoadText("t.obj", "mtllib ../../etc/passwd\n" + kSquare + "f 1 2 3\n");
    EXPECT_EQ(outside.code, ErrorCode::kInvalidScene);
    EXPECT_TRUE(outside.error.starts_with("t.obj: line 1: ")) << outside.error;
}

TEST(IoObj, verticesWithoutFacesAreAPointCloudWithColours) {
    const Loaded loaded = tryLoadText("t.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\n");
    ASSERT_EQ(loaded.error, "");
    const Mesh& mesh = loaded.scene.meshes.at(0);
    EXPECT_EQ(mesh.triangles.size(), 6u);
    EXPECT_EQ(mesh.colors.at(4), Vec4(0, 1, 0, 1));
}

TEST(IoObj, namesTheLineOfWhatIsWrong) {
    const auto errorOf = [](const std::string& text) { return tryLoadText("t.obj", text).error; };
    EXPECT_EQ(errorOf(kSquare + "f 1 2 5\n"),
              "t.obj: line 5: index 5, but there are 4 lines \"v\"");
    EXPECT_EQ(errorOf(kSquare + "f 0 1 2\n"),
              "t.obj: line 5: index 0, but there are 4 vertices so far");
    EXPECT_EQ(errorOf(kSquare + "f -5 1 2\n"),
              "t.obj: line 5: index -5, but there are 4 vertices so far");
    EXPECT_EQ(errorOf("x\n"), "t.obj: has no vertices: not an OBJ file");
    EXPECT_EQ(errorOf("v 0 0\n"), "t.obj: line 1: a number is missing");
    EXPECT_EQ(errorOf("v 0 zero 0\n"), "t.obj: line 1: \"zero\" is no number");
    EXPECT_EQ(errorOf("v 0 nan 0\n"), "t.obj: line 1: \"nan\" is beyond 1e15 or not finite");
    EXPECT_EQ(errorOf(kSquare + "f 1/x 2 3\n"), "t.obj: line 5: \"x\" is no index");
}

}  // namespace
}  // namespace stipple
