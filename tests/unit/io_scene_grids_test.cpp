// SPDX-License-Identifier: Apache-2.0
// Grids in scene files: tables of all kinds of files, alpha, wrapping, warnings and what is wrong.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <scenegraph/surface_at.h>

#include "io_test_support.h"

namespace stipple {
namespace {

template <class T>
void writePicture(const TempFolder& folder, const std::string& name, int width, int height,
                  const std::vector<T>& values, OIIO::TypeDesc type) {
    const std::string path = folder.path(name);
    const auto out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(width, height, int(values.size()) / (width * height), type);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    ASSERT_TRUE(out && out->open(path, spec) && out->write_image(type, values.data()));
    out->close();
}

Json gridScene(const Json& keys) {
    Json s = {{"version", 1}, {"root", "g"}};
    s["assets"]["g"] = {{"generate", "grid"}};
    s["assets"]["g"].update(keys);
    return s;
}

Loaded load(const TempFolder& folder, const Json& keys, LoadOptions options = {}) {
    return tryLoad(folder.write("s.scene.json", gridScene(keys).dump()), options);
}

// A step from 0 to 1 in the middle.
void writeTables(const TempFolder& folder) {
    writePicture(folder, "step.png", 4, 1, std::vector<uint16_t>{0, 0, 65535, 65535},
                 OIIO::TypeDesc::UINT16);
    writePicture(folder, "vector.exr", 1, 1, std::vector<float>{0.5f, 0.0f, 0.25f},
                 OIIO::TypeDesc::FLOAT);
    writePicture(folder, "nan.exr", 2, 1, std::vector<float>{0.0f, std::nanf("")},
                 OIIO::TypeDesc::FLOAT);
    writePicture(folder, "red.png", 1, 1, std::vector<uint8_t>{255, 0, 0}, OIIO::TypeDesc::UINT8);
    writePicture(folder, "clear.png", 2, 1, std::vector<uint8_t>{255, 0, 0, 255, 0, 255, 0, 0},
                 OIIO::TypeDesc::UINT8);
    folder.write("text.png", "no picture at all, but long enough");
}

TEST(IoSceneGrids, tablesMoveThePoints) {
    const TempFolder folder;
    writeTables(folder);
    Loaded loaded = load(
        folder,
        {{"size", {4, 2}}, {"displacement", {{"file", "step.png"}, {"low", -1}, {"high", 3}}}});
    ASSERT_EQ(loaded.error, "");
    DBox3 box = sceneBounds(loaded.scene);
    EXPECT_LT(glm::distance(box.min, DVec3(-2, -1, -1)), 0.02);
    EXPECT_LT(glm::distance(box.max, DVec3(2, 3, 1)), 0.02);
    EXPECT_EQ(loaded.scene.meshes[0].triangles.size(), 20u);  // 4 texels and both borders
    // A list is added up.
    const Json vector = {{"file", "vector.exr"}, {"along", "object"}};
    loaded = load(folder, {{"displacement", {vector, vector}}});
    ASSERT_EQ(loaded.error, "");
    EXPECT_LT(glm::distance(sceneBounds(loaded.scene).center(), DVec3(1.0, 0.0, 0.5)), 1e-5);
}

TEST(IoSceneGrids, picturesGiveColourAndAlpha) {
    const TempFolder folder;
    writeTables(folder);
    const auto at = [&](const Loaded& loaded, float x) {
        // The triangle and barycentrics do not matter: a triangle's vertices lie at u = 0 and 1.
        const Mesh& mesh = loaded.scene.meshes[0];
        const UVec3& t = mesh.triangles[0];
        for (int k = 0; k < 3; ++k) {
            const float u = mesh.uvs[t[(k + 1) % 3]].x, v = mesh.uvs[t[k]].x;
            if (u == v) continue;
            const float share = (x - v) / (u - v);
            const float b[3] = {k == 0   ? 1 - share
                                : k == 2 ? share
                                         : 0.0f,
                                k == 1   ? 1 - share
                                : k == 0 ? share
                                         : 0.0f,
                                k == 2   ? 1 - share
                                : k == 1 ? share
                                         : 0.0f};
            return alphaAt(mesh, loaded.scene.materials, loaded.scene.textures, 0, b[1], b[2]);
        }
        return -1.0f;
    };
    Loaded loaded = load(folder, {{"texture", "red.png"}});
    EXPECT_EQ(loaded.scene.materials[0].alpha_mode, AlphaMode::kOpaque);
    loaded = load(folder, {{"texture", "clear.png"}});
    EXPECT_EQ(loaded.scene.materials[0].alpha_mode, AlphaMode::kBlend);
    EXPECT_NEAR(at(loaded, 0.1f), 1.0f, 0.01f);
    EXPECT_NEAR(at(loaded, 0.9f), 0.0f, 0.01f);
    loaded =
        load(folder, {{"texture", "red.png"}, {"alpha_map", "step.png"}, {"alpha_cutoff", 0.4}});
    ASSERT_EQ(loaded.error, "");
    const Material& m = loaded.scene.materials[0];
    EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
    EXPECT_EQ(m.alpha_cutoff, 0.4f);
    const Texture& t = loaded.scene.textures[size_t(m.base_texture)];
    EXPECT_EQ(t.levels[0].width, 4);
    EXPECT_EQ(t.levels[0].rgba,
              (std::vector<uint8_t>{255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 255, 255, 0, 0, 255}));
    EXPECT_EQ(t.wrap_u, Wrap::kClamp);
    EXPECT_NEAR(at(loaded, 0.9f), 1.0f, 0.01f);
    loaded = load(folder, {{"alpha", 0.25}});
    EXPECT_EQ(loaded.scene.materials[0].alpha_mode, AlphaMode::kBlend);
    EXPECT_TRUE(loaded.scene.materials[0].double_sided);
    EXPECT_NEAR(at(loaded, 0.5f), 0.25f, 0.01f);
    // Around a body pictures close.
    loaded = load(folder, {{"surface", "sphere"}, {"texture", "red.png"}});
    EXPECT_EQ(loaded.scene.textures[0].wrap_u, Wrap::kRepeat);
    EXPECT_EQ(loaded.scene.textures[0].wrap_v, Wrap::kClamp);
    EXPECT_FALSE(loaded.scene.materials[0].double_sided);
    // A normal map needs tangents.
    loaded = load(folder, {{"surface", "torus"}, {"normal_map", "red.png"}, {"normal_scale", 0.5}});
    ASSERT_EQ(loaded.error, "");
    EXPECT_EQ(loaded.scene.meshes[0].tangents.size(), loaded.scene.meshes[0].positions.size());
    EXPECT_FALSE(loaded.scene.textures[0].srgb);
}

TEST(IoSceneGrids, warnWhereTheSurfacePullsApart) {
    const TempFolder folder;
    writeTables(folder);
    Json keys = {{"displacement", {{"file", "step.png"}, {"high", 2}}}};
    Loaded loaded = load(folder, keys);
    ASSERT_EQ(loaded.diagnostics.warnings.size(), 1u);
    EXPECT_NE(loaded.diagnostics.warnings[0].find(
                  "s.scene.json: /assets/g: the displaced surface pulls apart: at u 0."),
              std::string::npos)
        << loaded.diagnostics.warnings[0];
    keys["refine"] = 4;
    EXPECT_TRUE(load(folder, keys).diagnostics.warnings.empty());
}

TEST(IoSceneGrids, largeTablesAreBoundedUnlessAskedFor) {
    const TempFolder folder;
    writePicture(folder, "large.png", 4096, 512, std::vector<uint8_t>(4096 * 512, 7),
                 OIIO::TypeDesc::UINT8);
    Json keys = {{"displacement", {{"file", "large.png"}}}};
    Loaded loaded = load(folder, keys);
    ASSERT_EQ(loaded.error, "");
    EXPECT_LE(loaded.scene.meshes[0].triangles.size(), 2u << 20);
    EXPECT_GE(loaded.scene.meshes[0].triangles.size(), 19u << 16);
    ASSERT_EQ(loaded.diagnostics.warnings.size(), 1u);
    EXPECT_NE(
        loaded.diagnostics.warnings[0].find("have 4096 x 512 texels and the grid only 2896 x"),
        std::string::npos)
        << loaded.diagnostics.warnings[0];
    keys["resolution"] = {16, 8};
    loaded = load(folder, keys);
    EXPECT_TRUE(loaded.diagnostics.warnings.empty());
    EXPECT_EQ(loaded.scene.meshes[0].triangles.size(), 256u);
    keys["resolution"] = 3;
    EXPECT_EQ(load(folder, keys).scene.meshes[0].triangles.size(), 18u);
}

TEST(IoSceneGrids, tellWhatIsWrong) {
    const TempFolder folder;
    writeTables(folder);
    const auto expectError = [&](const Json& keys, const std::string& text) {
        const Loaded loaded = load(folder, keys);
        EXPECT_NE(loaded.error.find("s.scene.json: /assets/g" + text), std::string::npos)
            << keys << ": " << loaded.error;
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos);
    };
    const auto table = [](const char* file) { return Json{{"displacement", {{"file", file}}}}; };
    expectError({{"surface", "spher"}}, "/surface: ");
    expectError({{"surface", "plane"}, {"tube", 1}}, "/tube: means nothing for a plane");
    expectError({{"surface", "sphere"}, {"size", {1, 1}}}, "/size: means nothing for a sphere");
    expectError({{"heigth", 1}}, ": unknown key \"heigth\"; did you mean \"height\"?");
    expectError(table("none.png"), "/displacement/file: \"none.png\" cannot be opened");
    expectError(table("text.png"), "/displacement/file: not a PNG");
    expectError(table("../a.png"), "/displacement/file: \"../a.png\" lies outside");
    expectError(table("nan.exr"), "/displacement/file: the number at pixel 1, 0");
    expectError({{"displacement", Json::array({{{"file", "step.png"}}, {{"file", "nan.exr"}}})}},
                "/displacement/1/file: the number at pixel 1, 0");
    expectError({{"displacement", Json::array()}}, "/displacement");
    expectError({{"displacement", {{"low", 1}}}}, "/displacement");
    expectError({{"texture", "nan.exr"}}, "/texture: not a PNG, JPEG or WebP");
    expectError({{"alpha_map", "nan.exr"}}, "/alpha_map: the number at pixel 1, 0");
    expectError({{"resolution", 100000}}, "/resolution");
    expectError({{"resolution", {1, 2, 3}}}, "/resolution");
    expectError({{"resolution", 16384}}, ": a grid of 16384 x 16384 cells has more than");
    expectError({{"refine", 7}}, "/refine");
    expectError({{"repeat", {1, 0}}}, "/repeat/1");
    expectError({{"surface", "torus"}, {"repeat", {1, 1.5}}}, ": a torus closes on itself along v");
    expectError({{"radius", 0}, {"surface", "sphere"}}, "/radius");
    LoadOptions options;
    options.memory_limit_mb = 100;
    const Loaded loaded = load(folder, {{"resolution", 3000}}, options);
    EXPECT_EQ(loaded.code, ErrorCode::kOutOfMemory);
    EXPECT_NE(loaded.error.find("/assets/g: "), std::string::npos) << loaded.error;
}

TEST(IoSceneGrids, oddValuesNeverCrash) {
    const TempFolder folder;
    writeTables(folder);
    for (const char* surface : {"plane", "cone", "torus", "helicoid", "mobius"}) {
        Json keys = {{"surface", surface},      {"resolution", {6, 5}}, {"refine", 1},
                     {"repeat", {2, 1}},        {"texture", "red.png"}, {"alpha_map", "step.png"},
                     {"normal_map", "red.png"}, {"alpha_cutoff", 0.5},  {"color", {1, 0.5, 0.25}},
                     {"roughness", 0.5},        {"specular", 0.04}};
        keys["displacement"] = {{{"file", "step.png"}, {"low", 0}, {"high", 1}},
                                {{"file", "vector.exr"}, {"along", "surface"}, {"repeat", {1, 1}}}};
        if (std::string(surface) == "cone") keys["top_radius"] = 0.1;
        if (std::string(surface) != "plane") keys["radius"] = 2;
        ASSERT_EQ(load(folder, keys).error, "") << surface;
        forEachOddity(gridScene(keys), [&](const Json& changed) {
            const Loaded loaded = tryLoad(folder.write("s.scene.json", changed.dump()));
            EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << loaded.error;
        });
    }
}

TEST(IoSceneGrids, heightsOfARealTerrain) {
    const std::string data = testDataFolder();
    if (data.empty()) GTEST_SKIP() << "no folder of test data";
    const TempFolder folder;
    std::filesystem::copy_file(data + "/heightmaps/ruapehu_25m.png", folder.path("ruapehu.png"));
    Json scene = gridScene({{"size", {20000, 20000}},
                            {"displacement", {{"file", "ruapehu.png"}, {"high", 6553.5}}},
                            {"resolution", 512}});
    const Loaded grid = tryLoad(folder.write("s.scene.json", scene.dump()));
    ASSERT_EQ(grid.error, "");
    EXPECT_TRUE(grid.diagnostics.warnings.empty());
    scene["assets"]["g"] = {{"height_map", "ruapehu.png"}, {"spacing", 25}, {"high", 6553.5}};
    const Loaded map = tryLoad(folder.write("s.scene.json", scene.dump()));
    ASSERT_EQ(map.error, "");
    const DBox3 a = sceneBounds(grid.scene), b = sceneBounds(map.scene);
    // The mean over a cell cuts peaks.
    EXPECT_NEAR(a.max.y, b.max.y, 30.0);
    EXPECT_NEAR(a.min.y, b.min.y, 30.0);
}

}  // namespace
}  // namespace stipple
