// SPDX-License-Identifier: Apache-2.0
// What a scene file names beside models: included files, height maps, density maps, instance
// buffers, lights, environments; and files that are cut off or changed at random.
#include <OpenImageIO/imageio.h>
#include <core/image.h>
#include <core/rng.h>
#include <gtest/gtest.h>

#include "io_test_support.h"

namespace stipple {
namespace {

Json boxScene() {
    return Json::parse(R"({"version": 1, "assets": {"box": {"generate": "box", "triangles": 12}},
        "groups": {"all": {"instances": [{"child": "box"}]}}, "root": "all"})");
}

Loaded load(const TempFolder& folder, const Json& scene, LoadOptions options = {}) {
    return tryLoad(folder.write("s.scene.json", scene.dump()), options);
}

const Group& groupOf(const Loaded& loaded, const std::string& name) {
    for (const Group& g : loaded.scene.groups) {
        if (g.name == name) return g;
    }
    throw std::runtime_error("no group " + name);
}

// Writes a grey picture through OpenImageIO; type: of the file's numbers.
template <class T>
std::string writeGrey(const TempFolder& folder, const std::string& name, int width, int height,
                      const std::vector<T>& values, OIIO::TypeDesc type) {
    const std::string path = folder.path(name);
    const auto out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(width, height, int(values.size()) / (width * height), type);
    EXPECT_TRUE(out && out->open(path, spec) && out->write_image(type, values.data()));
    out->close();
    return path;
}

TEST(IoSceneInclude, bringsAssetsAndGroupsOfFilesAndTheirFilesOnce) {
    const TempFolder folder;
    folder.write("plants/deep/base.scene.json", R"({"version": 1,
        "assets": {"ball": {"generate": "sphere", "triangles": 20}}})");
    folder.write("plants/a.scene.json", R"({"version": 1, "include": ["deep/base.scene.json"],
        "groups": {"two": {"instances": [{"child": "ball"}, {"child": "ball", "translation": [3, 0, 0]}]}},
        "root": "two", "lights": {"suns": []}})");
    Json s = boxScene();
    s["include"] = {"plants/a.scene.json", "plants/deep/base.scene.json"};
    s["groups"]["all"]["instances"].push_back({{"child", "two"}});
    s["groups"]["all"]["instances"].push_back({{"child", "ball"}});
    const Loaded loaded = load(folder, s);
    ASSERT_EQ(loaded.error, "");
    EXPECT_EQ(sceneSize(loaded.scene).instances, 4.0);
    EXPECT_EQ(loaded.scene.meshes.size(), 2u);
    EXPECT_EQ(loaded.scene.lighting.suns.size(), 1u);  // of this file: the default
}

TEST(IoSceneInclude, namesTheFileThatIsWrong) {
    const TempFolder folder;
    folder.write("a.scene.json", R"({"version": 1, "include": ["sub/b.scene.json"]})");
    folder.write("sub/b.scene.json", R"({"version": 1, "include": ["../a.scene.json"]})");
    folder.write("clash.scene.json", R"({"version": 1, "assets": {"box": {"generate": "box"}}})");
    folder.write("sub/bad.scene.json", R"({"version": 1, "assets": {"x": {"generate": "cube"}}})");
    folder.write("sub/noasset.scene.json",
                 R"({"version": 1, "groups": {"g": {"instances": [{"child": "bo"}]}}})");
    const auto error = [&](const char* file) {
        Json s = boxScene();
        s["include"] = {file};
        return load(folder, s).error;
    };
    EXPECT_NE(error("a.scene.json")
                  .find("sub/b.scene.json: /include/0: \"../a.scene.json\" "
                        "includes itself"),
              std::string::npos)
        << error("a.scene.json");
    EXPECT_NE(error("s.scene.json").find("includes itself"), std::string::npos);
    EXPECT_NE(error("clash.scene.json").find("/assets/box: an included file"), std::string::npos);
    EXPECT_NE(error("sub/bad.scene.json").find("sub/bad.scene.json: /assets/x/generate"),
              std::string::npos);
    EXPECT_NE(error("sub/noasset.scene.json").find("did you mean \"box\""), std::string::npos);
    EXPECT_NE(error("../x.scene.json").find("/include/0: \"../x.scene.json\" lies outside"),
              std::string::npos);
    EXPECT_NE(error("none.scene.json").find("/include/0: \"none.scene.json\" cannot be opened"),
              std::string::npos);
    for (int i = 0; i < 30; ++i) {
        folder.write(
            "d" + std::to_string(i) + ".scene.json",
            R"({"version": 1, "include": ["d)" + std::to_string(i + 1) + R"(.scene.json"]})");
    }
    EXPECT_NE(error("d0.scene.json").find("levels deep"), std::string::npos);
}

TEST(IoSceneHeightMap, readsPngTiffAndExr) {
    const TempFolder folder;
    // 4 x 3 pixels, rising along x, more along z.
    std::vector<uint16_t> integers;
    std::vector<float> metres;
    for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 4; ++i) {
            integers.push_back(uint16_t(i * 6553.5 + j * 13107));  // (i + 2 j) / 10
            metres.push_back(float(i + 2 * j));
        }
    }
    writeGrey(folder, "h.png", 4, 3, integers, OIIO::TypeDesc::UINT16);
    writeGrey(folder, "h.tif", 4, 3, integers, OIIO::TypeDesc::UINT16);
    writeGrey(folder, "h.exr", 4, 3, metres, OIIO::TypeDesc::FLOAT);
    for (const char* file : {"h.png", "h.tif", "h.exr"}) {
        Json s = boxScene();
        s["assets"]["hill"] = {{"height_map", file}, {"spacing", 5}, {"style", "mountain"}};
        if (std::string(file) != "h.exr") s["assets"]["hill"]["high"] = 10;
        s["root"] = "hill";
        const Loaded loaded = load(folder, s);
        ASSERT_EQ(loaded.error, "");
        const DBox3 box = sceneBounds(loaded.scene);
        EXPECT_LT(glm::length(box.min - DVec3(-7.5, 0, -5)), 0.01) << file;
        EXPECT_LT(glm::length(box.max - DVec3(7.5, 7, 5)), 0.01) << file;
        s["assets"]["hill"]["step"] = 2;
        EXPECT_EQ(sceneSize(load(folder, s).scene).triangles_total, 2.0);
    }
    Json s = boxScene();
    s["assets"]["hill"] = {{"height_map", "h.png"}, {"spacing", 5}};
    EXPECT_NE(load(folder, s).error.find("/assets/hill: needs \"high\""), std::string::npos);
    metres[5] = std::nanf("");
    writeGrey(folder, "h.exr", 4, 3, metres, OIIO::TypeDesc::FLOAT);
    s["assets"]["hill"]["height_map"] = "h.exr";
    EXPECT_NE(load(folder, s).error.find("/assets/hill/height_map: the height at pixel 1, 1"),
              std::string::npos);
    folder.write("text.png", "no picture at all, but long enough");
    s["assets"]["hill"]["height_map"] = "text.png";
    EXPECT_NE(load(folder, s).error.find("/assets/hill/height_map: not a PNG"), std::string::npos);
}

TEST(IoSceneHeightMap, carriesATexture) {
    const TempFolder folder;
    writeGrey(folder, "h.png", 3, 3, std::vector<uint16_t>(9, 0), OIIO::TypeDesc::UINT16);
    writeGrey(folder, "t.png", 2, 1, std::vector<uint8_t>{255, 0, 0, 0, 255, 0},
              OIIO::TypeDesc::UINT8);
    Json s = boxScene();
    s["assets"]["hill"] = {
        {"height_map", "h.png"}, {"spacing", 5}, {"high", 10}, {"texture", "t.png"}};
    s["root"] = "hill";
    const Loaded loaded = load(folder, s);
    ASSERT_EQ(loaded.error, "");
    ASSERT_EQ(loaded.scene.textures.size(), 1u);
    const Mesh* hill = nullptr;
    for (const Mesh& m : loaded.scene.meshes) hill = m.name == "hill" ? &m : hill;
    ASSERT_TRUE(hill);
    for (size_t i = 0; i < hill->positions.size(); ++i) {
        EXPECT_NEAR(hill->uvs[i].x, hill->positions[i].x / 10 + 0.5f, 1e-6f);
        EXPECT_NEAR(hill->uvs[i].y, hill->positions[i].z / 10 + 0.5f, 1e-6f);
    }
    s["assets"]["hill"]["style"] = "meadow";
    EXPECT_NE(load(folder, s).error.find("both texture and style"), std::string::npos);
}

TEST(IoSceneHeightMap, readsRealHeightMaps) {
    const std::string data = testDataFolder();
    if (data.empty()) GTEST_SKIP() << "no folder of test data";
    const TempFolder folder;
    std::filesystem::copy(data + "/heightmaps/alps-montblanc.png", folder.path("alps.png"));
    Json s = boxScene();
    s["assets"]["alps"] = {
        {"height_map", "alps.png"}, {"spacing", 92.7}, {"low", 454}, {"high", 4810}, {"step", 4}};
    s["groups"]["all"]["scatter"] = {
        {"on", "alps"}, {"items", {{{"child", "box"}}}}, {"count", 2000}, {"max_height", 1500}};
    const Loaded loaded = load(folder, s);
    ASSERT_EQ(loaded.error, "");
    const DBox3 box = sceneBounds(loaded.scene);
    EXPECT_GT(box.extent().x, 50000.0);
    EXPECT_LE(box.max.y, 1501.0);
    EXPECT_GT(sceneSize(loaded.scene).instances, 200.0);
}

TEST(IoSceneDensityMap, thinsTheScattering) {
    const TempFolder folder;
    // Nothing in the west, half in the north-east, all in the south-east.
    writeGrey(folder, "d.png", 2, 2, std::vector<uint16_t>{0, 32768, 0, 65535},
              OIIO::TypeDesc::UINT16);
    Json s = boxScene();
    s["groups"]["all"]["scatter"] = {
        {"items", {{{"child", "box"}}}}, {"count", 40000}, {"size", 100}, {"density_map", "d.png"}};
    const Loaded loaded = load(folder, s);
    ASSERT_EQ(loaded.error, "");
    const Group& all = groupOf(loaded, "all");
    int west = 0, north = 0, south = 0;
    for (size_t i = 0; i < all.instances.size(); ++i) {
        const DVec3 p = all.instances.groupFromChild(i).translation;
        west += p.x < -25.0;
        north += p.x > 25.0 && p.z < -25.0;
        south += p.x > 25.0 && p.z > 25.0;
    }
    EXPECT_EQ(west, 0);
    EXPECT_NEAR(north, 1250, 150);
    EXPECT_NEAR(south, 2500, 220);
}

std::string record(uint32_t child, std::array<float, 10> numbers) {
    std::string bytes(reinterpret_cast<const char*>(&child), 4);
    return bytes + std::string(reinterpret_cast<const char*>(numbers.data()), 40);
}

TEST(IoSceneBuffer, readsRecords) {
    const TempFolder folder;
    folder.write("i.bin", record(0, {1, 2, 3, 0, 0, 0, 1, 1, 1, 1}) +
                              record(1, {-4, 0, 0, 0, 3, 0, 3, 2, 4, 6}));
    Json s = boxScene();
    s["assets"]["ball"] = {{"generate", "sphere"}, {"triangles", 20}};
    s["groups"]["all"] = {
        {"buffer", {{"file", "i.bin"}, {"children", {"box", "ball"}}, {"origin", {1e6, 0, 0.5}}}}};
    const Loaded loaded = load(folder, s);
    ASSERT_EQ(loaded.error, "");
    const Group& all = groupOf(loaded, "all");
    ASSERT_EQ(all.instances.size(), 2u);
    for (size_t i = 0; i < 2; ++i) {
        const bool is_first = all.listed_index[i] == 0;
        const Affine a = all.instances.groupFromChild(i);
        EXPECT_LT(glm::length(a.translation -
                              (is_first ? DVec3(1e6 + 1, 2, 3.5) : DVec3(1e6 - 4, 0, 0.5))),
                  1e-3);
        // The second is turned by 90 degrees about y: x goes to -z.
        EXPECT_LT(glm::length(a.linear[0] - (is_first ? DVec3(1, 0, 0) : DVec3(0, 0, -2))), 1e-6);
    }
}

TEST(IoSceneBuffer, namesTheRecordThatIsWrong) {
    const TempFolder folder;
    const std::string good = record(0, {1, 2, 3, 0, 0, 0, 1, 1, 1, 1});
    const auto error = [&](const std::string& bytes) {
        folder.write("i.bin", bytes);
        Json s = boxScene();
        s["groups"]["all"] = {{"buffer", {{"file", "i.bin"}, {"children", {"box"}}}}};
        return load(folder, s).error;
    };
    const std::string place = "s.scene.json: /groups/all/buffer/file: ";
    EXPECT_EQ(error(good + good), "");
    EXPECT_EQ(error(good + "x"), place + "45 bytes are no whole number of records of 44 bytes");
    EXPECT_EQ(error(good + record(1, {1, 2, 3, 0, 0, 0, 1, 1, 1, 1})),
              place + "record 1 names a child beyond the list of children");
    EXPECT_EQ(error(record(0, {std::nanf(""), 2, 3, 0, 0, 0, 1, 1, 1, 1})),
              place + "record 0 holds a number that is too large or none");
    EXPECT_EQ(error(good + good + record(0, {1, 2, 3, 0, 0, 0, 0, 1, 1, 1})),
              place + "record 2 has a quaternion of zero");
    EXPECT_EQ(error(record(0, {1, 2, 3, 0, 0, 0, 1, 1, 0, 1})),
              place + "record 0 flattens what it places");
}

TEST(IoSceneLights, readsPointsAndSpots) {
    const TempFolder folder;
    Json s = boxScene();
    s["lights"] = Json::parse(R"({"suns": [{"direction": [0, 1, 0]}, {"direction": [1, 0, 0]}],
        "points": [{"position": [1, 2, 3], "intensity": [5, 6, 7], "range": 20}],
        "spots": [{"position": [0, 5, 0], "target": [0, 0, 0], "inner_cone": 10, "outer_cone": 30},
                  {"position": [0, 5, 0], "direction": [2, 0, 0]}]})");
    const Loaded loaded = load(folder, s);
    ASSERT_EQ(loaded.error, "");
    const Lighting& lighting = loaded.scene.lighting;
    EXPECT_EQ(lighting.suns.size(), 2u);
    ASSERT_EQ(lighting.points.size(), 3u);
    EXPECT_EQ(lighting.points[0].position, DVec3(1, 2, 3));
    EXPECT_EQ(lighting.points[0].intensity, Vec3(5, 6, 7));
    EXPECT_EQ(lighting.points[0].range, 20.0f);
    EXPECT_FALSE(lighting.points[0].is_spot);
    EXPECT_TRUE(lighting.points[1].is_spot);
    EXPECT_EQ(lighting.points[1].axis, Vec3(0, -1, 0));
    EXPECT_NEAR(lighting.points[1].outer_cone, kPi / 6, 1e-6);
    EXPECT_EQ(lighting.points[2].axis, Vec3(1, 0, 0));

    const std::pair<const char*, const char*> wrong[] = {
        {R"({"points": [{"intensity": [1, 1, 1]}]})", "/lights/points/0"},
        {R"({"points": [{"position": [0, 0, 0], "range": -1}]})", "/lights/points/0/range"},
        {R"({"spots": [{"position": [0, 0, 0]}]})", "/lights/spots/0: needs target or direction"},
        {R"({"spots": [{"position": [0, 0, 0], "target": [0, 0, 0]}]})",
         "/lights/spots/0/target: the vector is zero"},
        {R"({"spots": [{"position": [0, 0, 0], "direction": [0, 1, 0], "inner_cone": 50}]})",
         "/lights/spots/0: inner_cone"},
        {R"({"spots": [{"position": [0, 0, 0], "direction": [0, 1, 0], "outer_cone": 120}]})",
         "/lights/spots/0/outer_cone"}};
    for (const auto& [lights, error] : wrong) {
        s["lights"] = Json::parse(lights);
        EXPECT_NE(load(folder, s).error.find(error), std::string::npos)
            << lights << load(folder, s).error;
    }
}

TEST(IoSceneLights, readsEnvironments) {
    const TempFolder folder;
    std::vector<float> pixels;
    for (int i = 0; i < 8 * 4; ++i) pixels.insert(pixels.end(), {0.5f, 0.25f, 8.0f});
    pixels[0] = std::nanf(""), pixels[1] = kInfinity, pixels[2] = -3.0f;
    writeGrey(folder, "e.exr", 8, 4, pixels, OIIO::TypeDesc::FLOAT);
    writeGrey(folder, "e.hdr", 8, 4, pixels, OIIO::TypeDesc::FLOAT);
    writeGrey(folder, "e.png", 4, 2, std::vector<uint8_t>(24, 188), OIIO::TypeDesc::UINT8);
    Json s = boxScene();
    for (const char* file : {"e.exr", "e.hdr", "e.png"}) {
        s["background"] = {{"environment", {{"file", file}, {"turn", 90}, {"brightness", 2}}}};
        const Loaded loaded = load(folder, s);
        ASSERT_EQ(loaded.error, "");
        ASSERT_TRUE(loaded.scene.lighting.sky.environment);
        const Environment& e = *loaded.scene.lighting.sky.environment;
        const bool is_png = std::string(file) == "e.png";
        const Vec3 expected = is_png ? Vec3(1.0f) : Vec3(1.0f, 0.5f, 16.0f);
        EXPECT_LT(glm::length(e.radiance.back() - expected), is_png ? 0.02f : 0.1f) << file;
        EXPECT_LT(glm::length(loaded.scene.lighting.sky.horizon - expected), 0.1f) << file;
        for (const Vec3& v : e.radiance) {
            for (int c = 0; c < 3; ++c) EXPECT_TRUE(v[c] >= 0.0f && v[c] <= 2.0f * 65504.0f);
        }
        EXPECT_TRUE(loaded.scene.lighting.suns.empty());  // the picture has its own
    }
    s["background"]["environment"]["file"] = "s.scene.json";
    EXPECT_NE(load(folder, s).error.find("/background/environment/file: not a PNG"),
              std::string::npos);
}

// Everything a scene file can name, so that all readers meet damaged files.
Json everything(const TempFolder& folder) {
    writeGrey(folder, "h.png", 5, 4, std::vector<uint16_t>(20, 3000), OIIO::TypeDesc::UINT16);
    writeGrey(folder, "d.tif", 3, 3, std::vector<uint8_t>(9, 100), OIIO::TypeDesc::UINT8);
    writeGrey(folder, "e.exr", 4, 2, std::vector<float>(24, 0.5f), OIIO::TypeDesc::FLOAT);
    folder.write("i.bin", record(0, {1, 2, 3, 0, 0, 0, 1, 1, 1, 1}));
    folder.write("more.scene.json",
                 R"({"version": 1, "assets": {"ball": {"generate": "sphere"}}})");
    return Json::parse(R"({"version": 1, "include": ["more.scene.json"],
        "assets": {"box": {"generate": "box", "triangles": 12},
                   "hill": {"height_map": "h.png", "spacing": 2.5, "low": 1, "high": 30, "step": 1, "style": "mountain", "seed": 2}},
        "groups": {
            "stones": {"scatter": {"on": "ball", "items": [{"child": "box"}], "spacing": 0.2, "align": 1, "max_slope": 120}},
            "all": {"instances": [{"child": "hill"}, {"child": "stones"}],
                    "buffer": {"file": "i.bin", "children": ["ball"], "origin": [0, 0, 1]},
                    "scatter": {"on": "hill", "items": [{"child": "box"}], "count": 30, "spacing": 0.5, "density_map": "d.tif"}}},
        "root": "all",
        "lights": {"points": [{"position": [1, 2, 3], "intensity": [5, 6, 7], "range": 20}],
                   "spots": [{"position": [0, 5, 0], "target": [0, 0, 0], "inner_cone": 10, "outer_cone": 30, "intensity": [1, 1, 1]}]},
        "background": {"environment": {"file": "e.exr", "turn": 20, "brightness": 2}, "haze_distance": 100}})");
}

void expectNoCrash(const Loaded& loaded, const std::string& what) {
    EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << loaded.error;
    EXPECT_TRUE(loaded.error.empty() || loaded.code != ErrorCode::kInternal)
        << what << ": " << loaded.error;
    if (loaded.error.empty() && !sceneBounds(loaded.scene).isEmpty()) {
        EXPECT_TRUE(isFinite(sceneBounds(loaded.scene).extent())) << what;
    }
}

TEST(IoSceneFuzz, everyValueMayBeReplacedByAnother) {
    const TempFolder folder;
    const Json scene = everything(folder);
    LoadOptions options;
    options.memory_limit_mb = 20;
    ASSERT_EQ(load(folder, scene, options).error, "");
    int loaded_count = 0;
    forEachOddity(scene, [&](const Json& changed) {
        const Loaded loaded = load(folder, changed, options);
        expectNoCrash(loaded, changed.dump());
        loaded_count += loaded.error.empty();
    });
    EXPECT_GT(loaded_count, 50);
}

TEST(IoSceneFuzz, filesMayBeCutOffOrDamagedAnywhere) {
    const TempFolder folder;
    const Json scene = everything(folder);
    LoadOptions options;
    options.memory_limit_mb = 20;
    const std::string path = folder.write("s.scene.json", scene.dump());
    Rng rng{11};
    for (const char* name :
         {"s.scene.json", "more.scene.json", "h.png", "d.tif", "e.exr", "i.bin"}) {
        std::string bytes;
        {
            std::ifstream file(folder.path(name), std::ios::binary);
            bytes.assign(std::istreambuf_iterator<char>(file), {});
        }
        ASSERT_FALSE(bytes.empty());
        for (int i = 0; i < 40; ++i) {
            folder.write(name, bytes.substr(0, size_t(rng.uniform() * double(bytes.size()))));
            expectNoCrash(tryLoad(path, options), std::string(name) + " cut off");
            std::string damaged = bytes;
            for (int k = 0; k < 4; ++k)
                damaged[size_t(rng.uniform() * double(bytes.size()))] = char(rng.next());
            folder.write(name, damaged);
            expectNoCrash(tryLoad(path, options), std::string(name) + " damaged");
        }
        folder.write(name, bytes);
    }
    EXPECT_EQ(tryLoad(path, options).error, "");
}

}  // namespace
}  // namespace stipple
