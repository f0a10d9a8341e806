// SPDX-License-Identifier: Apache-2.0
// The scene file: what is in it arrives, and what is wrong is named by JSON pointer.
#include <gtest/gtest.h>

#include "io_test_support.h"

#include <chrono>

namespace stipple {
namespace {

// A scene of one box at (1, 2, 3) that tests change.
Json minimal() {
    return Json::parse(R"({
        "version": 1,
        "assets": {"ball": {"generate": "box", "triangles": 12, "color": [1, 0, 0]}},
        "groups": {"all": {"instances": [{"child": "ball", "translation": [1, 2, 3]}]}},
        "root": "all"
    })");
}

Loaded load(const Json& scene, LoadOptions options = {}) {
    return tryLoadText("s.scene.json", scene.dump(), options);
}

Loaded loadChecked(const Json& scene) {
    Loaded loaded = load(scene);
    EXPECT_EQ(loaded.error, "");
    return loaded;
}

const Group& rootOf(const Loaded& loaded) { return loaded.scene.groups.at(loaded.scene.root); }

// Where the root's only instance puts a point.
DVec3 placed(const Json& scene, const DVec3& p) {
    const Loaded loaded = loadChecked(scene);
    EXPECT_EQ(rootOf(loaded).instances.size(), 1u);
    return rootOf(loaded).instances.size() ? rootOf(loaded).instances.groupFromChild(0).point(p)
                                           : DVec3(0);
}

void expectNear(const DVec3& a, const DVec3& b) {
    EXPECT_NEAR(glm::length(a - b), 0.0, 1e-5) << a.x << " " << a.y << " " << a.z;
}

TEST(IoSceneFile, loadsAMinimalSceneWithDefaults) {
    const Loaded loaded = loadChecked(minimal());
    EXPECT_EQ(loaded.scene.meshes.size(), 1u);
    ASSERT_EQ(loaded.scene.cameras.size(), 1u);
    EXPECT_EQ(loaded.scene.cameras[0].name, "default");
    ASSERT_EQ(loaded.scene.lighting.suns.size(), 1u);
    EXPECT_NEAR(glm::length(loaded.scene.lighting.suns[0].direction_to_light), 1.0f, 1e-6f);
    const DBox3 bounds = sceneBounds(loaded.scene);
    expectNear(bounds.min, DVec3(0.5, 1.5, 2.5));
    expectNear(bounds.max, DVec3(1.5, 2.5, 3.5));
    EXPECT_TRUE(loaded.diagnostics.warnings.empty());
}

TEST(IoSceneFile, composesScaleThenRotationThenTranslation) {
    Json s = minimal();
    Json& i = s["groups"]["all"]["instances"][0];
    expectNear(placed(s, DVec3(1, 0, 0)), DVec3(2, 2, 3));
    i["scale"] = {2, 3, 4};
    i["rotation"] = {0, 0, 90};
    expectNear(placed(s, DVec3(1, 1, 1)), DVec3(1 - 3, 2 + 2, 3 + 4));
    i["scale"] = -2;
    expectNear(placed(s, DVec3(1, 1, 1)), DVec3(1 + 2, 2 - 2, 3 - 2));
    // About x first, then about z: y goes to z and stays there.
    i = {{"child", "ball"}, {"rotation", {90, 0, 90}}};
    expectNear(placed(s, DVec3(0, 1, 0)), DVec3(0, 0, 1));
    expectNear(placed(s, DVec3(1, 0, 0)), DVec3(0, 1, 0));
    i = {{"child", "ball"}, {"quaternion", {0, 0, 3, 3}}};
    expectNear(placed(s, DVec3(1, 0, 0)), DVec3(0, 1, 0));
    i = {{"child", "ball"}, {"matrix", {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 2, 0, 7, 8, 9, 1}}};
    expectNear(placed(s, DVec3(1, 0, 1)), DVec3(7, 9, 11));
}

TEST(IoSceneFile, nestsGroupsAndTakesAnAssetAsRoot) {
    Json s = minimal();
    s["groups"]["twice"] = Json::parse(
        R"({"instances": [{"child": "all"}, {"child": "all", "translation": [10, 0, 0]}]})");
    s["root"] = "twice";
    const Loaded loaded = loadChecked(s);
    EXPECT_EQ(sceneSize(loaded.scene).instances, 2.0);
    EXPECT_EQ(sceneSize(loaded.scene).triangles_total, 24.0);
    EXPECT_EQ(loaded.scene.meshes.size(), 1u);
    s["root"] = "ball";
    EXPECT_EQ(sceneSize(loadChecked(s).scene).instances, 1.0);
}

TEST(IoSceneFile, joinsInstancesScatterAndGrid) {
    Json s = minimal();
    s["assets"]["hill"] =
        Json::parse(R"({"generate": "terrain", "size": 100, "resolution": 17, "relief": 5})");
    s["groups"]["all"]["scatter"] =
        Json::parse(R"({"on": "hill", "items": [{"child": "ball", "weight": 2}], "count": 400})");
    s["groups"]["all"]["grid"] = Json::parse(
        R"({"child": "ball", "count_x": 3, "count_z": 4, "spacing_x": 2, "spacing_z": 2})");
    const Loaded loaded = loadChecked(s);
    const size_t n = rootOf(loaded).instances.size();
    EXPECT_GT(n, 1u + 12u + 200u);
    EXPECT_LT(n, 1u + 12u + 600u);
    EXPECT_LT(loaded.scene.groups[loaded.scene.root].bounds.extent().x,
              110.0);  // the terrain's size is the default
}

TEST(IoSceneFile, makesEveryKindOfAsset) {
    Json s = minimal();
    s["assets"] = Json::parse(R"({
        "oak": {"generate": "tree", "species": "oak", "seed": 2, "height": 8, "triangles": 2000, "comment": "small"},
        "tuft": {"generate": "grass", "seed": 1, "height": 0.3, "radius": 0.2, "blades": 20},
        "stone": {"generate": "rock", "seed": 1, "radius": 0.5, "subdivisions": 2},
        "hill": {"generate": "terrain", "size": 50, "resolution": 9, "style": "mountain", "relief": 3, "feature_size": 20, "seed": 4},
        "ball": {"generate": "sphere", "triangles": 100}, "box": {"generate": "box"},
        "floor": {"generate": "plane", "triangles": 2}, "ring": {"generate": "torus", "triangles": 200, "color": [0, 0.5, 1]}})");
    Json list = Json::array();
    for (const auto& [name, unused] : s["assets"].items()) list.push_back({{"child", name}});
    s["groups"]["all"]["instances"] = list;
    const Loaded loaded = loadChecked(s);
    EXPECT_EQ(loaded.scene.meshes.size(), 8u);
    for (const Mesh& mesh : loaded.scene.meshes) {
        EXPECT_FALSE(mesh.triangles.empty()) << mesh.name;
        for (uint16_t m : mesh.triangle_material)
            ASSERT_LT(m, loaded.scene.materials.size()) << mesh.name;
    }
}

TEST(IoSceneFile, loadsFilesOnceAndDropsTheirCamerasAndLights) {
    const TempFolder folder;
    GltfBuilder b = GltfBuilder::triangle();
    b.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 1}}}}};
    b.json["nodes"].push_back({{"camera", 0}});
    b.json["scenes"][0]["nodes"].push_back(1);
    folder.write("models/t.glb", b.glb());
    Json s = minimal();
    s["assets"]["house"] = s["assets"]["hut"] = {{"file", "models/t.glb"}};
    s["groups"]["all"]["instances"].push_back({{"child", "house"}});
    s["groups"]["all"]["instances"].push_back({{"child", "hut"}});
    const Loaded loaded = tryLoad(folder.write("s.scene.json", s.dump()));
    ASSERT_EQ(loaded.error, "");
    EXPECT_EQ(loaded.scene.meshes.size(), 2u);
    ASSERT_EQ(loaded.scene.cameras.size(), 1u);
    EXPECT_EQ(loaded.scene.cameras[0].name, "default");
}

TEST(IoSceneFile, assetsMayUseFilesOfTheWholeSceneFolderOnly) {
    const TempFolder folder;
    GltfBuilder b = GltfBuilder::triangle();
    folder.write("scene/buffers/t.bin", b.bin);
    folder.write("t.bin", b.bin);
    Json s = minimal();
    s["assets"]["house"] = {{"file", "models/t.gltf"}};
    s["root"] = "house";
    const std::string path = folder.write("scene/s.scene.json", s.dump());
    b.json["buffers"] = {{{"byteLength", b.bin.size()}, {"uri", "../buffers/t.bin"}}};
    folder.write("scene/models/t.gltf", b.gltf());
    EXPECT_EQ(tryLoad(path).error, "");
    b.json["buffers"][0]["uri"] = "../../t.bin";
    folder.write("scene/models/t.gltf", b.gltf());
    EXPECT_NE(
        tryLoad(path).error.find("models/t.gltf: buffers[0].uri: \"../../t.bin\" lies outside"),
        std::string::npos);
    LoadOptions options;
    options.allow_outside = true;
    EXPECT_EQ(tryLoad(path, options).error, "");
}

TEST(IoSceneFile, readsCamerasLightsBackgroundAndRenderDefaults) {
    Json s = minimal();
    s["cameras"] = Json::parse(R"([
        {"name": "a", "eye": [0, 0, 10], "target": [0, 0, 0], "fov": 60, "near": 1, "far": 100},
        {"name": "b", "eye": [0, 9, 0], "direction": [0, -1, 0], "up": [0, 0, -1], "orthographic": 20}])");
    s["lights"] = Json::parse(R"({"suns": [{"direction": [0, 2, 0], "irradiance": [1, 2, 3]}]})");
    s["background"] = Json::parse(
        R"({"zenith": [0, 0, 1], "horizon": [1, 1, 1], "ground": [0.5, 0, 0], "haze_distance": 500})");
    s["exposure"] = -1.5;
    s["render"] =
        Json::parse(R"({"samples": 2.5, "shadows": true, "method": "raycast", "width": 320})");
    const Loaded loaded = loadChecked(s);
    const Scene& scene = loaded.scene;
    ASSERT_EQ(scene.cameras.size(), 2u);
    EXPECT_NEAR(scene.cameras[0].fov_y, kPi / 3, 1e-12);
    expectNear(scene.cameras[0].world_from_camera[2], DVec3(0, 0, -1));
    EXPECT_EQ(scene.cameras[0].near_z, 1.0);
    EXPECT_TRUE(scene.cameras[1].orthographic);
    EXPECT_EQ(scene.cameras[1].height, 20.0);
    expectNear(scene.cameras[1].world_from_camera[2], DVec3(0, -1, 0));
    expectNear(scene.cameras[1].world_from_camera[1], DVec3(0, 0, 1));
    ASSERT_EQ(scene.lighting.suns.size(), 1u);
    EXPECT_EQ(scene.lighting.suns[0].direction_to_light, Vec3(0, 1, 0));
    EXPECT_EQ(scene.lighting.suns[0].irradiance, Vec3(1, 2, 3));
    EXPECT_EQ(scene.lighting.sky.ground, Vec3(0.5f, 0, 0));
    EXPECT_EQ(scene.lighting.sky.haze_distance, 500.0f);
    EXPECT_EQ(scene.lighting.exposure, -1.5f);
    EXPECT_EQ(scene.render_defaults.at("samples"), "2.5");
    EXPECT_EQ(scene.render_defaults.at("shadows"), "on");
    EXPECT_EQ(scene.render_defaults.at("width"), "320");
    s["lights"] = Json::object();
    EXPECT_TRUE(loadChecked(s).scene.lighting.suns.empty());
}

TEST(IoSceneFile, scalesModelsFromFiles) {
    const TempFolder folder;
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n");
    const std::string scene = folder.write("s.scene.json", R"({"version": 1,
        "assets": {"cm": {"file": "t.obj", "scale": 0.01}, "m": {"file": "t.obj"}},
        "groups": {"all": {"instances": [{"child": "cm", "translation": [5, 0, 0]}],
                           "scatter": {"on": "cm", "items": [{"child": "m"}], "count": 3,
                                       "max_slope": 180}}},
        "root": "all"})");
    const Loaded loaded = tryLoad(scene);
    ASSERT_EQ(loaded.error, "");
    EXPECT_EQ(loaded.scene.meshes.size(), 1u);  // the file is kept once
    EXPECT_EQ(meshInstances(loaded.scene), std::vector<double>{4.0});
    const DBox3 bounds = sceneBounds(loaded.scene);
    EXPECT_NEAR(bounds.max.x, 5.01, 1e-6);
    for (size_t i = 0; i < rootOf(loaded).instances.size(); ++i) {
        const DVec3 at = rootOf(loaded).instances.groupFromChild(i).translation;
        EXPECT_TRUE(std::abs(at.x - 5.0) < 1e-6 || (at.x <= 0.01 && at.y <= 0.02)) << at.x;
    }
}

TEST(IoSceneFile, aScatterRuleWithoutAnyPlaceIsOneWarning) {
    Json s = minimal();
    s["assets"]["ground"] = {{"generate", "terrain"}, {"resolution", 9}, {"size", 50}};
    s["groups"]["all"]["scatter"] = {
        {"on", "ground"}, {"count", 200}, {"min_height", 9000}, {"items", {{{"child", "ball"}}}}};
    const Loaded loaded = loadChecked(s);
    EXPECT_EQ(rootOf(loaded).instances.size(), 1u);
    ASSERT_EQ(loaded.diagnostics.warnings.size(), 1u);
    EXPECT_TRUE(loaded.diagnostics.warnings[0].ends_with(
        "s.scene.json: /groups/all/scatter: nothing found a place"));
}

TEST(IoSceneFile, countsHowOftenEachMeshIsShown) {
    Json s = minimal();
    s["assets"]["unused"] = {{"generate", "box"}};
    s["groups"]["row"] = {{"grid", {{"child", "all"}, {"count_x", 5}, {"count_z", 4}}},
                          {"instances", {{{"child", "ball"}}}}};
    s["root"] = "row";
    const Loaded loaded = loadChecked(s);
    EXPECT_EQ(meshInstances(loaded.scene), (std::vector<double>{21.0, 0.0}));
}

TEST(IoSceneFile, lakesKeepTheirOwnRipples) {
    Json s = minimal();
    for (const char* name : {"lake_1", "lake_2"}) {
        s["assets"][name] = Json::parse(
            R"({"generate": "terrain", "resolution": 33, "relief": 50, "water_level": 20})");
        s["assets"][name]["seed"] = name[5] - '0';
    }
    const Scene scene = loadChecked(s).scene;
    ASSERT_EQ(scene.textures.size(), 2u);
    EXPECT_NE(scene.textures[0].levels[0].rgba, scene.textures[1].levels[0].rgba);
    std::vector<int> maps;
    for (const Material& m : scene.materials) {
        if (m.name == "water") maps.push_back(m.normal_map.texture);
    }
    EXPECT_EQ(maps, (std::vector<int>{0, 1}));
}

TEST(IoSceneFile, aGroupMayHaveSeveralScatterRules) {
    Json s = minimal();
    const Json few = Json::parse(
                   R"({"items": [{"child": "ball"}], "count": 7, "size": 10, "seed": 1})"),
               more = Json::parse(
                   R"({"items": [{"child": "ball"}], "count": 5, "size": 90, "seed": 2})");
    const auto instances = [&](const Json& rules) {
        s["groups"]["all"] = {{"scatter", rules}};
        std::vector<DVec3> places;
        const Scene scene = loadChecked(s).scene;
        const InstanceStore& store = scene.groups[scene.root].instances;
        for (size_t i = 0; i < store.size(); ++i)
            places.push_back(store.groupFromChild(i).translation);
        return places;
    };
    // The same places as each rule alone.
    std::vector<DVec3> both = instances({few, more}), apart = instances(few);
    for (const DVec3& p : instances(Json::array({more}))) apart.push_back(p);
    ASSERT_GT(both.size(), 6u);
    ASSERT_EQ(both.size(), apart.size());
    const auto lessX = [](const DVec3& a, const DVec3& b) { return a.x < b.x; };
    std::sort(both.begin(), both.end(), lessX);
    std::sort(apart.begin(), apart.end(), lessX);
    for (size_t i = 0; i < both.size(); ++i) EXPECT_LT(glm::length(both[i] - apart[i]), 1e-4);

    const auto error = [&](const Json& rules) {
        s["groups"]["all"] = {{"scatter", rules}};
        const TempFolder folder;
        return tryLoad(folder.write("s.scene.json", s.dump())).error;
    };
    Json wrong = few;
    wrong["items"][0]["child"] = "bell";
    EXPECT_NE(error({few, wrong}).find("/groups/all/scatter/1/items/0/child: "), std::string::npos)
        << error({few, wrong});
    wrong = few;
    wrong["count"] = -1;
    EXPECT_NE(error({few, wrong}).find("/groups/all/scatter/1/count: "), std::string::npos);
    EXPECT_NE(error(Json::array()).find("/groups/all/scatter: "), std::string::npos);
}

TEST(IoSceneFile, readsPaths) {
    Json s = minimal();
    s["paths"] = Json::parse(R"([
        {"name": "walk", "up": [0, 0, 2], "near": 1, "far": 50, "keys": [
            {"eye": [0, 0, 0], "target": [9, 0, 0], "fov": 60}, {"eye": [0, 3, 4], "target": [9, 0, 0]},
            {"eye": [0, 3, 6], "target": [9, 1, 0], "fov": 30}]},
        {"name": "turn", "keys": [{"eye": [1, 2, 3], "direction": [0, 0, -5], "time": -2},
                                  {"eye": [1, 2, 3], "direction": [4, 0, 0], "time": 8}]}])");
    const Loaded loaded = loadChecked(s);
    ASSERT_EQ(loaded.scene.paths.size(), 2u);
    const CameraPath& walk = *loaded.scene.findPath("walk");
    EXPECT_EQ(walk.up, DVec3(0, 0, 1));
    EXPECT_EQ(walk.near_z, 1.0);
    EXPECT_EQ(walk.far_z, 50.0);
    ASSERT_EQ(walk.keys.size(), 3u);
    EXPECT_FALSE(walk.aims_are_directions);
    const double times[] = {0.0, 5.0, 7.0};  // the lengths of the way
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(walk.keys[i].time, times[i], 1e-12);
    EXPECT_EQ(walk.keys[2].aim, DVec3(9, 1, 0));
    EXPECT_NEAR(walk.keys[1].fov_y, kPi / 3, 1e-12);  // of the key before
    EXPECT_NEAR(walk.keys[2].fov_y, kPi / 6, 1e-12);
    const CameraPath& turn = *loaded.scene.findPath("turn");
    EXPECT_TRUE(turn.aims_are_directions);
    EXPECT_EQ(turn.keys[1].time, 8.0);
    EXPECT_EQ(turn.keys[1].aim, DVec3(1, 0, 0));
    EXPECT_EQ(loaded.scene.findPath("run"), nullptr);
}

TEST(IoSceneFile, namesWhatIsWrongWithPaths) {
    const auto error = [](const std::string& paths) {
        Json s = minimal();
        s["paths"] = Json::parse(paths);
        const TempFolder folder;
        return tryLoad(folder.write("s.scene.json", s.dump())).error;
    };
    const std::string one = R"({"eye": [0, 0, 0], "target": [0, 0, 1]})";
    const std::pair<std::string, const char*> cases[] = {
        {R"([{"name": "a", "keys": []}])", "/paths/0/keys: "},
        {R"([{"name": "a", "keys": [)" + one + "]}]", "/paths/0/keys: "},
        {R"([{"keys": [)" + one + "," + one + "]}]", "/paths/0: "},
        {R"([{"name": "a", "keys": [)" + one + "," + one + "]}]",
         "/paths/0/keys/1: the eye is where it was before"},
        {R"([{"name": "a", "keys": [)" + one + R"(, {"eye": [0, 0, 2]}]}])",
         "/paths/0/keys/1: needs target or direction"},
        {R"([{"name": "a", "keys": [)" + one + R"(, {"eye": [0, 0, 2], "target": [0, 0, 2]}]}])",
         "/paths/0/keys/1/target: the vector is zero"},
        {R"([{"name": "a", "keys": [)" + one + R"(, {"eye": [0, 0, 2], "direction": [0, 0, 1]}]}])",
         "/paths/0/keys/1: some keys have target and some direction"},
        {R"([{"name": "a", "keys": [)" + one +
             R"(, {"eye": [0, 0, 2], "target": [0, 0, 1], "time": 3}]}])",
         "/paths/0/keys/1: has a time and others have not"},
        {R"([{"name": "a", "keys": [{"eye": [0, 0, 1], "target": [0, 0, 2], "time": 3},
             {"eye": [0, 0, 0], "target": [0, 0, 1], "time": 3}]}])",
         "/paths/0/keys/1/time: is not later"},
        {R"([{"name": "a", "keys": [)" + one +
             R"(, {"eye": [0, 0, 2], "target": [0, 0, 1], "fov": 200}]}])",
         "/paths/0/keys/1/fov: "},
        {R"([{"name": "a", "near": 5, "far": 4, "keys": [)" + one +
             R"(, {"eye": [0, 0, 2], "target": [0, 0, 1]}]}])",
         "/paths/0: near is not less"},
        {R"([{"name": "a", "keys": [)" + one + R"(, {"eye": [0, 0, 2], "target": [0, 0, 1]}]},
            {"name": "a", "keys": [)" +
             one + R"(, {"eye": [0, 0, 2], "target": [0, 0, 1]}]}])",
         "/paths/1: a path before has the name \"a\" too"}};
    for (const auto& [paths, expected] : cases) {
        EXPECT_NE(error(paths).find(expected), std::string::npos) << paths << "\n"
                                                                  << error(paths) << "\n"
                                                                  << expected;
    }
}

// One change that makes the scene wrong, as a JSON merge patch, and how the error begins and what
// it says.
struct Wrong {
    const char* patch;
    const char* where;
    const char* what;
};

TEST(IoSceneFile, namesWhatIsWrongByJsonPointer) {
    const Wrong cases[] = {
        {R"({"version": 2})", "/version", "none of 1"},
        {R"({"root": null})", "/", "'root'"},
        {R"({"root": "al"})", "/root", "did you mean \"all\""},
        {R"({"extra": 1})", "/", "unknown key \"extra\""},
        {R"({"assets": {"ball": {"color": [1, 0]}}})", "/assets/ball/color", "no fewer than 3"},
        {R"({"assets": {"ball": {"color": [1, 0, -1]}}})", "/assets/ball/color/2", "got -1"},
        {R"({"assets": {"ball": {"generate": "cube"}}})", "/assets/ball/generate",
         "\"cube\" is none of \"tree\""},
        {R"({"assets": {"ball": {"species": "oak"}}})", "/assets/ball", "unknown key \"species\""},
        {R"({"assets": {"a": {"generate": "tree", "species": "elm"}}})", "/assets/a/species",
         "\"elm\" is none of \"oak\""},
        {R"({"assets": {"a": {}}})", "/assets/a", "'file'"},
        {R"({"assets": {"a": {"file": "x.glb", "height": 2}}})", "/assets/a",
         "unknown key \"height\""},
        {R"({"assets": {"a": {"file": "x.glb", "scal": 2}}})", "/assets/a",
         "unknown key \"scal\"; did you mean \"scale\"?"},
        {R"({"assets": {"a": {"generate": "rock", "raduis": 2}}})", "/assets/a",
         "unknown key \"raduis\"; did you mean \"radius\"?"},
        {R"({"assets": {"a": {"file": "x.glb", "scale": 0}}})", "/assets/a/scale", "got 0"},
        {R"({"assets": {"a/b": {"generate": "rock", "radius": 0}}})", "/assets/a~1b/radius",
         "got 0"},
        {R"({"assets": {"a": {"file": "x.obj"}}})", "/assets/a/file", "cannot be opened"},
        {R"({"groups": {"ball": {"grid": {"child": "ball"}}}})", "/groups/ball",
         "an asset has this name too"},
        {R"({"groups": {"all": {"instances": [{"child": "bal"}]}}})",
         "/groups/all/instances/0/child", "did you mean \"ball\""},
        {R"({"groups": {"all": {"instances": [{"child": "ball"}, {"translation": [0, 0, 0]}]}}})",
         "/groups/all/instances/1", "'child'"},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "translation": [0, 0]}]}}})",
         "/groups/all/instances/0/translation", "3 elements"},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "translation": [0, 0, 1e10]}]}}})",
         "/groups/all/instances/0/translation/2", "got 1"},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "scale": "big"}]}}})",
         "/groups/all/instances/0/scale", "wrong type"},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "scale": [1, 0, 1]}]}}})",
         "/groups/all/instances/0", "singular"},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "turn": 3}]}}})",
         "/groups/all/instances/0", "unknown key \"turn\""},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "rotation": [0,0,0], "quaternion": [0,0,0,1]}]}}})",
         "/groups/all/instances/0", "both rotation and quaternion"},
        {R"({"groups": {"all": {"instances": [{"child": "ball", "quaternion": [0,0,0,0]}]}}})",
         "/groups/all/instances/0", "quaternion is zero"},
        {R"({"groups": {"all": {"instances": [7]}}})", "/groups/all/instances/0", "wrong type"},
        {R"({"groups": {"all": {"instances": 7}}})", "/groups/all/instances", "wrong type"},
        {R"({"groups": {"all": {"scatter": {"items": []}}}})", "/groups/all/scatter/items",
         "fewer than 1"},
        {R"({"groups": {"all": {"scatter": {"items": [{"child": "oak"}]}}}})",
         "/groups/all/scatter/items/0/child", "no asset or group \"oak\""},
        {R"({"groups": {"all": {"scatter": {"on": "all", "items": [{"child": "ball"}]}}}})",
         "/groups/all/scatter/on", "is a group"},
        {R"({"groups": {"all": {"scatter": {"on": "ball", "size": 3, "items": [{"child": "ball"}]}}}})",
         "/groups/all/scatter/size", "no meaning"},
        {R"({"groups": {"all": {"scatter": {"items": [{"child": "ball"}], "min_scale": 2, "max_scale": 1}}}})",
         "/groups/all/scatter", "min_scale > max_scale"},
        {R"({"groups": {"all": {"scatter": {"items": [{"child": "ball"}], "max_slope": 190}}}})",
         "/groups/all/scatter/max_slope", "got 190"},
        {R"({"groups": {"all": {"grid": {"child": "ball", "count_x": 0}}}})",
         "/groups/all/grid/count_x", "got 0"},
        {R"({"cameras": [{"name": "a", "eye": [0, 0, 0]}]})", "/cameras/0", "target"},
        {R"({"cameras": [{"name": "a", "eye": [0, 0, 0], "target": [0, 0, 0]}]})",
         "/cameras/0/target", "zero"},
        {R"({"cameras": [{"name": "a", "eye": [0, 0, 0], "target": [0, 0, 1], "near": 2, "far": 1}]})",
         "/cameras/0", "near"},
        {R"({"cameras": [{"name": "a", "eye": [0, 0, 0], "target": [0, 0, 1], "fov": 9, "orthographic": 1}]})",
         "/cameras/0", "both fov"},
        {R"({"cameras": [{"name": "a", "eye": [0, 0, 0], "target": [0, 0, 1]}, {"name": "a", "eye": [0, 0, 0], "target": [0, 0, 1]}]})",
         "/cameras/1", "name \"a\" too"},
        {R"({"lights": {"suns": [{"direction": [0, 0, 0]}]}})", "/lights/suns/0/direction", "zero"},
        {R"({"background": {"zenit": [0, 0, 0]}})", "/background",
         "unknown key \"zenit\"; did you mean \"zenith\"?"},
        {R"({"render": {"sampels": 2}})", "/render/sampels", "samples"},
        {R"({"render": {"samples": "many"}})", "/render/samples", ""},
        {R"({"render": {"samples": [2]}})", "/render/samples", "wrong type"},
    };
    for (const Wrong& wrong : cases) {
        Json s = minimal();
        s.merge_patch(Json::parse(wrong.patch));
        const Loaded loaded = load(s);
        EXPECT_TRUE(loaded.error.starts_with("s.scene.json: " + std::string(wrong.where) + ": "))
            << wrong.patch << "\nsays: " << loaded.error;
        EXPECT_NE(loaded.error.find(wrong.what), std::string::npos)
            << wrong.patch << "\nsays: " << loaded.error;
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos);
        EXPECT_TRUE(loaded.code == ErrorCode::kInvalidScene ||
                    loaded.code == ErrorCode::kFileNotFound)
            << loaded.error;
    }
}

TEST(IoSceneFile, refusesOtherFilesAndCycles) {
    Json s = minimal();
    s["groups"]["all"]["instances"].push_back({{"child", "other"}});
    s["groups"]["other"]["instances"] = {{{"child", "all"}}};
    const Loaded cycle = load(s);
    EXPECT_EQ(cycle.code, ErrorCode::kInvalidScene);
    EXPECT_NE(cycle.error.find("contains itself"), std::string::npos);

    EXPECT_EQ(tryLoadText("s.fbx", "x").code, ErrorCode::kUnsupported);
    EXPECT_EQ(tryLoad("/nonexistent/s.scene.json").code, ErrorCode::kFileNotFound);
    const Loaded broken = tryLoadText("s.scene.json", "{\n  \"version\": 1,\n}");
    EXPECT_EQ(broken.code, ErrorCode::kParse);
    EXPECT_TRUE(broken.error.starts_with("s.scene.json: line 3, column 1: ")) << broken.error;
    const TempFolder folder;
    std::filesystem::create_directories(folder.path("d.scene.json"));
    EXPECT_EQ(tryLoad(folder.path("d.scene.json")).code, ErrorCode::kFileNotFound);
}

TEST(IoSceneFile, refusesWhatWouldNotFitIntoMemory) {
    const char* const cases[] = {
        R"({"groups": {"all": {"scatter": {"items": [{"child": "ball"}], "count": 1000000000000}}}})",
        R"({"groups": {"all": {"grid": {"child": "ball", "count_x": 4294967295, "count_z": 4294967295}}}})",
        R"({"assets": {"t": {"generate": "sphere", "triangles": 50000000}}})",
        R"({"assets": {"t": {"generate": "terrain", "resolution": 16385}}})",
    };
    for (const char* patch : cases) {
        Json s = minimal();
        s.merge_patch(Json::parse(patch));
        LoadOptions options;
        options.memory_limit_mb = 1000;
        const Loaded loaded = load(s, options);
        EXPECT_EQ(loaded.code, ErrorCode::kOutOfMemory) << patch;
        EXPECT_NE(loaded.error.find("memory limit of 1 GB"), std::string::npos) << loaded.error;
    }
    Json s = minimal();  // without a limit the machine's memory counts
    s["groups"]["all"]["scatter"] =
        Json::parse(R"({"items": [{"child": "ball"}], "count": 1000000000000})");
    EXPECT_EQ(load(s).code, ErrorCode::kOutOfMemory);
}

TEST(IoSceneFile, stopsWhenCancelled) {
    CancelFlag cancel;
    cancel.requested = true;
    LoadOptions options;
    options.cancel = &cancel;
    EXPECT_EQ(load(minimal(), options).code, ErrorCode::kCancelled);
}

TEST(IoSceneFile, anEmptySceneLoadsWithAWarning) {
    Json s = minimal();
    s["groups"]["all"]["instances"] = Json::array();
    const Loaded loaded = loadChecked(s);
    EXPECT_EQ(loaded.diagnostics.warnings.size(), 1u);
    EXPECT_EQ(loaded.scene.cameras.size(), 1u);
}

TEST(IoSceneFile, everyPrefixIsRefusedWithOneLine) {
    const std::string text = minimal().dump(1);
    const TempFolder folder;
    for (size_t n = 0; n < text.size(); n += 7) {
        const Loaded loaded = tryLoad(folder.write("s.scene.json", text.substr(0, n)));
        ASSERT_EQ(loaded.code, ErrorCode::kParse) << n;
        ASSERT_EQ(loaded.error.find('\n'), std::string::npos);
    }
}

TEST(IoSceneFile, everyValueMayBeReplacedByAnother) {
    const Json scene = Json::parse(R"({
        "version": 1,
        "assets": {"ball": {"generate": "sphere", "triangles": 20, "color": [1, 0.5, 0]},
                   "hill": {"generate": "terrain", "seed": 1, "size": 60, "resolution": 5, "relief": 6, "feature_size": 20, "style": "meadow"},
                   "oak": {"generate": "tree", "species": "birch", "seed": 3, "height": 6, "triangles": 1000},
                   "tuft": {"generate": "grass", "seed": 1, "height": 0.2, "radius": 0.1, "blades": 3},
                   "rock": {"generate": "rock", "seed": 1, "radius": 1, "subdivisions": 1}},
        "groups": {
            "wood": {"scatter": {"on": "hill", "items": [{"child": "oak", "weight": 2}, {"child": "tuft"}], "count": 20, "size": 50,
                "center": [1, 2], "min_slope": 0, "max_slope": 40, "min_height": -9, "max_height": 9, "min_scale": 0.5, "max_scale": 2,
                "tilt": 5, "align": 0.3, "sink": 0.1, "clustering": 0.5, "seed": 4}},
            "all": {"instances": [{"child": "hill"}, {"child": "wood"},
                {"child": "ball", "translation": [1, 2, 3], "rotation": [10, 20, 30], "scale": [1, 2, 3]},
                {"child": "rock", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}],
                "grid": {"child": "wood", "count_x": 3, "count_z": 2, "spacing_x": 60, "spacing_z": 60, "jitter": 2, "any_turn": true,
                "quarter_turns": false, "min_scale": 0.5, "max_scale": 2, "hill_height": 3, "hill_size": 100, "seed": 1}}},
        "root": "all",
        "cameras": [{"name": "a", "eye": [0, 5, 20], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 50, "near": 1, "far": 99},
                    {"name": "b", "eye": [0, 50, 0], "direction": [0, -1, 0], "orthographic": 40}],
        "lights": {"suns": [{"direction": [1, 2, 1], "irradiance": [3, 3, 3]}]},
        "background": {"zenith": [0.2, 0.4, 0.8], "haze_distance": 500},
        "exposure": 0.5,
        "render": {"samples": 2}})");
    const TempFolder folder;
    LoadOptions options;
    options.memory_limit_mb = 20;
    int loaded_count = 0;
    ASSERT_EQ(tryLoad(folder.write("s.scene.json", scene.dump()), options).error, "");
    forEachOddity(scene, [&](const Json& changed) {
        const Loaded loaded = tryLoad(folder.write("s.scene.json", changed.dump()), options);
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << loaded.error;
        EXPECT_TRUE(loaded.error.empty() || loaded.code != ErrorCode::kInternal) << loaded.error;
        EXPECT_TRUE(loaded.error.empty() || loaded.error.starts_with("s.scene.json: "))
            << loaded.error;
        loaded_count += loaded.error.empty();
        if (loaded.error.empty() && !sceneBounds(loaded.scene).isEmpty()) {
            EXPECT_TRUE(isFinite(sceneBounds(loaded.scene).extent())) << changed.dump();
        }
    });
    EXPECT_GT(loaded_count, 100);
}

TEST(IoSceneFile, theSameFileGivesTheSameScene) {
    Json s = minimal();
    s["groups"]["all"]["scatter"] =
        Json::parse(R"({"items": [{"child": "ball"}], "count": 100, "seed": 5})");
    const Loaded a = loadChecked(s), b = loadChecked(s);
    ASSERT_EQ(rootOf(a).instances.size(), rootOf(b).instances.size());
    for (size_t i = 0; i < rootOf(a).instances.size(); ++i) {
        ASSERT_EQ(rootOf(a).instances.groupFromChild(i).translation,
                  rootOf(b).instances.groupFromChild(i).translation);
    }
}

}  // namespace
}  // namespace stipple
