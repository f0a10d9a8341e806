// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/generators.h>
#include <tools/generated_scene.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

// "oak_1", "oak_2", "birch_1", ...: two trees of each species, and what grows between them.
Json plantAssets(uint64_t seed) {
    Json assets = Json::object();
    for (const std::string& species : treeSpecies()) {
        for (uint64_t i = 1; i <= 2; ++i) {
            assets[species + "_" + std::to_string(i)] = {{"generate", "tree"},
                                                         {"species", species},
                                                         {"seed", seed + i},
                                                         {"triangles", 20000}};
        }
    }
    assets["rock"] = {{"generate", "rock"}, {"seed", seed}, {"radius", 0.8}, {"subdivisions", 3}};
    assets["grass"] = {{"generate", "grass"}, {"seed", seed}};
    return assets;
}

Json item(const std::string& child, double weight) {
    return {{"child", child}, {"weight", weight}};
}

Json lookingAt(const char* name, const DVec3& eye, const DVec3& target) {
    return {{"name", name},
            {"eye", {eye.x, eye.y, eye.z}},
            {"target", {target.x, target.y, target.z}},
            {"fov", 45}};
}

Json instanceAt(const char* child, double x, double z) {
    return {{"child", child}, {"translation", {x, 0.0, z}}};
}

}  // namespace

std::string forestSceneJson(const GeneratedSceneParams& params) {
    constexpr double kTreesPerSquareMetre = 0.03;
    const double size =
        params.size > 0.0 ? params.size : std::sqrt(double(params.count) / kTreesPerSquareMetre);
    TerrainParams ground;
    ground.seed = params.seed;
    ground.size = size;
    ground.resolution = std::clamp(int(size / 4.0), 33, 1025);
    ground.relief = std::min(60.0, 0.08 * size);
    ground.feature_size = std::min(400.0, size);
    ground.style = "forest_floor";
    ground.erosion = 0.4;
    const HeightField field = makeHeightField(ground);

    Json scene = {{"version", 1}};
    scene["assets"] = plantAssets(params.seed);
    scene["assets"].erase("grass");
    scene["assets"]["ground"] = {{"generate", "terrain"},   {"seed", ground.seed},
                                 {"size", ground.size},     {"resolution", ground.resolution},
                                 {"relief", ground.relief}, {"feature_size", ground.feature_size},
                                 {"style", ground.style},   {"erosion", ground.erosion}};
    const Json items = {item("oak_1", 2),    item("oak_2", 2),    item("beech_1", 2),
                        item("beech_2", 2),  item("birch_1", 1),  item("birch_2", 1),
                        item("spruce_1", 3), item("spruce_2", 3), item("pine_1", 1),
                        item("pine_2", 1),   item("rock", 0.5)};
    scene["groups"]["forest"] = {{"instances", {{{"child", "ground"}}}},
                                 {"scatter",
                                  {{"on", "ground"},
                                   {"items", items},
                                   {"count", params.count},
                                   {"max_slope", 50},
                                   {"min_scale", 0.6},
                                   {"max_scale", 1.2},
                                   {"tilt", 3},
                                   {"sink", 0.1},
                                   {"clustering", 0.4},
                                   {"seed", params.seed}}}};
    scene["root"] = "forest";

    // Above the crowns at the border, and standing in the middle.
    constexpr double kAboveTrees = 35.0, kEyeHeight = 1.7;
    const DVec3 border(0.0, field.height(0.0, 0.48 * size) + kAboveTrees, 0.48 * size);
    const DVec3 middle(0.0, field.height(0.0, 0.0) + kEyeHeight, 0.0);
    scene["cameras"] = {lookingAt("overview", border, DVec3(0.0, field.height(0.0, 0.0), 0.0)),
                        lookingAt("walk", middle, middle + DVec3(10.0, 1.0, -20.0))};
    scene["background"] = {{"haze_distance", std::max(2000.0, 2.0 * size)}};
    return scene.dump(2) + "\n";
}

std::string landscapeSceneJson(const GeneratedSceneParams& params) {
    constexpr double kPatch = 200.0;  // metres
    constexpr double kBlock = 2.0 * kPatch;
    constexpr uint64_t kBlocksInRegion = 16;  // along a side
    constexpr double kRegion = kBlock * kBlocksInRegion;

    Json scene = {{"version", 1}};
    scene["assets"] = plantAssets(params.seed);
    scene["assets"]["floor"] = {{"generate", "terrain"}, {"seed", params.seed},
                                {"size", kPatch},        {"resolution", 51},
                                {"relief", 0},           {"style", "forest_floor"}};
    scene["assets"]["green"] = {{"generate", "terrain"}, {"seed", params.seed},
                                {"size", kPatch},        {"resolution", 51},
                                {"relief", 0},           {"style", "meadow"}};

    uint64_t per_block = 0;
    const auto addPatch = [&](const char* name, const char* ground, uint64_t count,
                              double clustering, Json items) {
        scene["groups"][name] = {{"instances", {{{"child", ground}}}},
                                 {"scatter",
                                  {{"items", std::move(items)},
                                   {"count", count},
                                   {"size", kPatch},
                                   {"min_scale", 0.6},
                                   {"max_scale", 1.2},
                                   {"tilt", 3},
                                   {"sink", 0.05},
                                   {"clustering", clustering},
                                   {"seed", params.seed + per_block}}}};
        per_block += count + 1;
    };
    addPatch("conifers", "floor", 1500, 0.2,
             {item("spruce_1", 3), item("spruce_2", 3), item("pine_1", 2), item("pine_2", 2)});
    addPatch("mixed", "floor", 1300, 0.4,
             {item("oak_1", 3), item("oak_2", 3), item("birch_1", 2), item("birch_2", 2),
              item("spruce_1", 2)});
    addPatch("clearing", "green", 1200, 0.7,
             {item("birch_1", 1), item("pine_1", 1), item("rock", 1), item("grass", 20)});
    addPatch("meadow", "green", 1500, 0.5,
             {item("oak_2", 1), item("rock", 0.5), item("grass", 40)});

    const uint64_t per_region = per_block * kBlocksInRegion * kBlocksInRegion;
    const uint64_t regions =
        uint64_t(std::max(1.0, std::ceil(std::sqrt(double(params.count) / double(per_region)))));
    const uint64_t blocks =
        regions > 1 ? kBlocksInRegion
                    : uint64_t(std::max(
                          1.0, std::ceil(std::sqrt(double(params.count) / double(per_block)))));
    const double h = 0.5 * kPatch;
    scene["groups"]["block"]["instances"] = {
        instanceAt("conifers", -h, -h), instanceAt("clearing", h, -h), instanceAt("meadow", -h, h),
        instanceAt("mixed", h, h)};
    scene["groups"]["region"]["grid"] = {
        {"child", "block"},    {"count_x", blocks},     {"count_z", blocks},  {"spacing_x", kBlock},
        {"spacing_z", kBlock}, {"quarter_turns", true}, {"seed", params.seed}};
    scene["groups"]["landscape"]["grid"] = {{"child", "region"},
                                            {"count_x", regions},
                                            {"count_z", regions},
                                            {"spacing_x", kBlock * double(blocks)},
                                            {"spacing_z", kBlock * double(blocks)},
                                            {"quarter_turns", true},
                                            {"seed", params.seed + 1}};
    scene["root"] = "landscape";

    const double z = regions > 1 ? 0.4 * kRegion * double(regions) : 0.45 * kBlock * double(blocks);
    scene["cameras"] = {lookingAt("flight", DVec3(0.0, 120.0, z), DVec3(0.0, 0.0, z - 900.0)),
                        lookingAt("high", DVec3(0.0, 900.0, z), DVec3(0.0, 0.0, z - 2500.0))};
    scene["background"] = {{"haze_distance", 25000}};
    return scene.dump(2) + "\n";
}

}  // namespace stipple
