// SPDX-License-Identifier: Apache-2.0
// glTF files that are wrong, by accident or on purpose: one clear line each, never a crash, a hang
// or a memory explosion.
#include <gtest/gtest.h>

#include "io_test_support.h"

#include <core/rng.h>

#include <limits>

namespace stipple {
namespace {

std::string errorOf(GltfBuilder& builder, LoadOptions options = {}) {
    return tryLoadText("t.gltf", builder.gltf(), options).error;
}

#define EXPECT_STARTS_WITH(text, start) \
    EXPECT_TRUE(std::string(text).starts_with(start)) << "is: " << (text) << "\nnot: " << (start)

TEST(IoGltfInvalid, namesFileAndPathOfAnIndexOutOfRange) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["indices"] = b.add<uint16_t>({0, 1, 912}, "SCALAR", 5123);
    EXPECT_EQ(errorOf(b), "t.gltf: meshes[0].primitives[0].indices: index 912 >= vertex count 3");
}

TEST(IoGltfInvalid, checksEveryIndexIntoTheDocument) {
    const auto with = [](auto change) {
        GltfBuilder b = GltfBuilder::triangle();
        change(b.json);
        return errorOf(b);
    };
    EXPECT_STARTS_WITH(with([](Json& j) { j["scene"] = 7; }), "t.gltf: scene: index 7");
    EXPECT_STARTS_WITH(with([](Json& j) { j["scenes"][0]["nodes"] = {1}; }),
                       "t.gltf: scenes[0].nodes[0]: index 1");
    EXPECT_STARTS_WITH(with([](Json& j) { j["nodes"][0]["children"] = {3}; }),
                       "t.gltf: nodes[0].children[0]: index 3");
    EXPECT_STARTS_WITH(with([](Json& j) { j["nodes"][0]["mesh"] = 3; }),
                       "t.gltf: nodes[0].mesh: index 3");
    EXPECT_STARTS_WITH(with([](Json& j) { j["nodes"][0]["camera"] = 0; }),
                       "t.gltf: nodes[0].camera: index 0");
    EXPECT_STARTS_WITH(with([](Json& j) { j["meshes"][0]["primitives"][0]["material"] = 5; }),
                       "t.gltf: meshes[0].primitives[0].material: index 5");
    EXPECT_STARTS_WITH(
        with([](Json& j) { j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 5; }),
        "t.gltf: meshes[0].primitives[0].attributes.POSITION: index 5");
    EXPECT_NE(with([](Json& j) { j["meshes"][0]["primitives"][0]["indices"] = 5; }), "");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["bufferView"] = 9; }),
                       "t.gltf: accessors[0].bufferView: index 9");
    EXPECT_STARTS_WITH(with([](Json& j) { j["bufferViews"][0]["buffer"] = 9; }),
                       "t.gltf: bufferViews[0].buffer: index 9");
    EXPECT_STARTS_WITH(
        with([](Json& j) {
            j["meshes"][0]["primitives"][0]["material"] = 0;
            j["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 4}}}}}}};
        }),
        "t.gltf: materials[0].pbrMetallicRoughness.baseColorTexture.index: index 4");
}

TEST(IoGltfInvalid, checksBoundsOfViewsAndAccessorsWithoutOverflow) {
    const auto with = [](auto change) {
        GltfBuilder b = GltfBuilder::triangle();
        change(b.json);
        return errorOf(b);
    };
    EXPECT_STARTS_WITH(with([](Json& j) { j["bufferViews"][0]["byteOffset"] = 1000000; }),
                       "t.gltf: bufferViews[0]: ");
    EXPECT_STARTS_WITH(with([](Json& j) { j["bufferViews"][0]["byteLength"] = 43; }),
                       "t.gltf: bufferViews[0]: ");
    EXPECT_STARTS_WITH(
        with([](Json& j) { j["bufferViews"][0]["byteOffset"] = 18446744073709551615ull; }),
        "t.gltf: bufferViews[0].byteOffset: ");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["byteOffset"] = 4; }),
                       "t.gltf: accessors[0]: 3 elements lie beyond");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["count"] = 4; }),
                       "t.gltf: accessors[0]: 4 elements lie beyond");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["count"] = 4294967295u; }),
                       "t.gltf: accessors[0]: ");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["count"] = -1; }),
                       "t.gltf: accessors[0].count: ");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["count"] = 2.5; }),
                       "t.gltf: accessors[0].count: ");
    EXPECT_STARTS_WITH(with([](Json& j) { j["bufferViews"][0]["byteStride"] = 252; }),
                       "t.gltf: accessors[0]: ");
    EXPECT_STARTS_WITH(with([](Json& j) { j["bufferViews"][0]["byteStride"] = 8; }),
                       "t.gltf: accessors[0]: byteStride 8 <");
    EXPECT_STARTS_WITH(with([](Json& j) { j["accessors"][0]["componentType"] = 5130; }),
                       "t.gltf: accessors[0].componentType: ");
}

TEST(IoGltfInvalid, checksAttributesAgainstEachOther) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["attributes"]["NORMAL"] = b.addFloats({0, 0, 1, 0, 0, 1}, "VEC3");
    EXPECT_STARTS_WITH(
        errorOf(b),
        "t.gltf: meshes[0].primitives[0].attributes.NORMAL: count 2, but POSITION has 3");
    GltfBuilder c = GltfBuilder::triangle();
    c.primitive()["attributes"]["POSITION"] = 1;
    EXPECT_STARTS_WITH(
        errorOf(c),
        "t.gltf: meshes[0].primitives[0].attributes.POSITION: accessors[1] has the wrong type");
    GltfBuilder d = GltfBuilder::triangle();
    d.primitive()["indices"] = d.addFloats({0, 1, 2}, "SCALAR");
    EXPECT_STARTS_WITH(
        errorOf(d),
        "t.gltf: meshes[0].primitives[0].indices: accessors[2] is not of unsigned integers");
}

TEST(IoGltfInvalid, refusesValuesThatAreNotFiniteOrTooLarge) {
    for (float bad :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e30f}) {
        GltfBuilder b = GltfBuilder::triangle();
        b.primitive()["attributes"]["POSITION"] =
            b.addFloats({0, 0, 0, 1, 0, 0, 0, bad, 0}, "VEC3");
        EXPECT_STARTS_WITH(errorOf(b), "t.gltf: meshes[0].primitives[0].attributes.POSITION: ");
    }
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = Json::array();
    for (int i = 0; i < 20; ++i)
        b.json["nodes"].push_back({{"scale", {1e30, 1e30, 1e30}}, {"children", {i + 1}}});
    b.json["nodes"].push_back({{"mesh", 0}});
    EXPECT_NE(errorOf(b).find("not finite"), std::string::npos);
}

TEST(IoGltfInvalid, refusesSparseIndicesOutOfRangeOrOrder) {
    for (const std::vector<uint16_t>& indices : {std::vector<uint16_t>{1, 3}, {1, 1}, {2, 0}}) {
        GltfBuilder b = GltfBuilder::triangle();
        const int at = b.addView(indices), values = b.addView<float>({1, 2, 3, 4, 5, 6});
        b.json["accessors"][0]["sparse"] = {
            {"count", 2},
            {"indices", {{"bufferView", at}, {"componentType", 5123}}},
            {"values", {{"bufferView", values}}}};
        EXPECT_STARTS_WITH(errorOf(b), "t.gltf: accessors[0].sparse.indices: index ");
    }
}

TEST(IoGltfInvalid, refusesNodesThatContainThemselves) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = {{{"children", {1}}}, {{"children", {2}}}, {{"children", {1}}}};
    EXPECT_EQ(errorOf(b), "t.gltf: nodes[2].children[0]: node 1 contains itself");
}

TEST(IoGltfInvalid, refusesExponentiallyManyNodes) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = Json::array();
    for (int i = 0; i < 40; ++i) b.json["nodes"].push_back({{"children", {i + 1, i + 1}}});
    b.json["nodes"].push_back(Json::object());
    EXPECT_NE(errorOf(b).find("more than 10^6 nodes"), std::string::npos);
}

TEST(IoGltfInvalid, walksLongChainsOfNodesWithoutOverflowingTheStack) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = Json::array();
    const int n = 200000;
    for (int i = 0; i < n; ++i) b.json["nodes"].push_back({{"children", {i + 1}}});
    b.json["nodes"].push_back({{"mesh", 0}});
    EXPECT_EQ(errorOf(b), "");
}

TEST(IoGltfInvalid, refusesDeepNestingOfExtras) {
    std::string text = GltfBuilder::triangle().gltf();
    text.insert(1, "\"extras\":" + std::string(200000, '[') + std::string(200000, ']') + ",");
    EXPECT_NE(tryLoadText("t.gltf", text).error.find("levels deep"), std::string::npos);
}

TEST(IoGltfInvalid, refusesMemoryThatIsNotThereBeforeAllocatingIt) {
    // An accessor without data is all zero and may have any count.
    GltfBuilder b = GltfBuilder::triangle();
    b.json["accessors"][0].erase("bufferView");
    b.json["accessors"][0]["count"] = 4294967295u;
    LoadOptions options;
    options.memory_limit_mb = 100;
    const Loaded loaded = tryLoadText("t.gltf", b.gltf(), options);
    EXPECT_EQ(loaded.code, ErrorCode::kOutOfMemory);
    EXPECT_STARTS_WITH(loaded.error, "t.gltf: meshes[0].primitives[0]: 4294967295 vertices");
    // Many meshes over the same bytes.
    GltfBuilder c = GltfBuilder::triangle();
    c.json["accessors"][0].erase("bufferView");
    c.json["accessors"][0]["count"] = 100000;
    const Json mesh = c.json["meshes"][0];
    for (int i = 1; i < 100; ++i) {
        c.json["meshes"].push_back(mesh);
        c.json["nodes"].push_back({{"mesh", i}});
        c.json["scenes"][0]["nodes"].push_back(i);
    }
    EXPECT_EQ(tryLoadText("t.gltf", c.gltf(), options).code, ErrorCode::kOutOfMemory);
}

TEST(IoGltfInvalid, keepsFilesInsideTheFolder) {
    const TempFolder folder;
    GltfBuilder b = GltfBuilder::triangle();
    folder.write("secret.bin", b.bin);
    std::filesystem::create_directories(folder.path("scene"));
    std::filesystem::create_symlink(folder.path("secret.bin"), folder.path("scene/link.bin"));
    for (const std::string& uri :
         {std::string("../secret.bin"), std::string("%2e%2e/secret.bin"), folder.path("secret.bin"),
          std::string("link.bin"), std::string("x/../../secret.bin")}) {
        b.json["buffers"] = {{{"byteLength", b.bin.size()}, {"uri", uri}}};
        const std::string path = folder.write("scene/t.gltf", b.gltf());
        const Loaded refused = tryLoad(path);
        EXPECT_NE(refused.error.find("lies outside of the scene's folder"), std::string::npos)
            << uri << ": " << refused.error;
        LoadOptions options;
        options.allow_outside = true;
        EXPECT_EQ(tryLoad(path, options).error.find("lies outside"), std::string::npos) << uri;
    }
}

TEST(IoGltfInvalid, refusesUrisThatAreNoFiles) {
    const TempFolder folder;
    GltfBuilder b = GltfBuilder::triangle();
    std::filesystem::create_directories(folder.path("dir.bin"));
    for (const char* uri :
         {"http://example.com/a.bin", "data:,x", "data:application/octet-stream;base64,A*AA",
          "none.bin", "dir.bin", "", "file:///etc/passwd"}) {
        b.json["buffers"] = {{{"byteLength", b.bin.size()}, {"uri", uri}}};
        EXPECT_STARTS_WITH(tryLoad(folder.write("t.gltf", b.gltf())).error, "t.gltf: buffers[0].");
    }
    b.json["buffers"] = {{{"byteLength", 1000}, {"uri", "data:;base64," + base64(b.bin)}}};
    EXPECT_STARTS_WITH(errorOf(b), "t.gltf: buffers[0].byteLength: 1000 > the 42 bytes");
}

TEST(IoGltfInvalid, refusesDamagedAndForeignPictures) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["material"] = 0;
    b.json["textures"] = {{{"source", 0}}};
    b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    const std::string header("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
    for (const std::string& bytes :
         {std::string("not a picture at all"), std::string("x"), header,
          header + std::string("\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x06\0\0\0crc!", 17),
          std::string("\xff\xd8\xff\xe0 and no more of it")}) {
        b.json["images"] = {{{"uri", "data:image/png;base64," + base64(bytes)}}};
        EXPECT_STARTS_WITH(errorOf(b), "t.gltf: images[0]: ");
    }
}

TEST(IoGltfInvalid, refusesRequiredExtensionsAndVersionsByName) {
    for (const char* name : {"KHR_texture_basisu", "VENDOR_x"}) {
        GltfBuilder b = GltfBuilder::triangle();
        b.json["extensionsUsed"] = b.json["extensionsRequired"] = {name};
        const Loaded loaded = tryLoadText("t.gltf", b.gltf());
        EXPECT_EQ(loaded.code, ErrorCode::kUnsupported);
        EXPECT_EQ(loaded.error,
                  "t.gltf: extensionsRequired: \"" + std::string(name) + "\" is not supported");
    }
    GltfBuilder b = GltfBuilder::triangle();
    b.json["asset"]["version"] = "1.0";
    EXPECT_EQ(tryLoadText("t.gltf", b.gltf()).code, ErrorCode::kUnsupported);
}

TEST(IoGltfInvalid, everyPrefixOfABinaryFileIsRefusedWithOneLine) {
    const std::string whole = GltfBuilder::triangle().glb();
    const TempFolder folder;
    ASSERT_EQ(tryLoad(folder.write("t.glb", whole)).error, "");
    for (size_t n = 0; n < whole.size(); ++n) {
        const Loaded loaded = tryLoad(folder.write("t.glb", whole.substr(0, n)));
        ASSERT_TRUE(loaded.error.starts_with("t.glb: "))
            << "of " << n << " bytes: " << loaded.error;
        ASSERT_EQ(loaded.error.find('\n'), std::string::npos);
    }
}

TEST(IoGltfInvalid, flippedBytesLoadOrAreRefusedWithOneLine) {
    const std::string whole = GltfBuilder::triangle().glb();
    const TempFolder folder;
    LoadOptions options;
    options.memory_limit_mb = 1000;
    Rng rng{1, 0};
    for (int i = 0; i < 300; ++i) {
        std::string damaged = whole;
        for (int k = 0; k <= i % 3; ++k) damaged[rng.next() % damaged.size()] = char(rng.next());
        const Loaded loaded = tryLoad(folder.write("t.glb", damaged), options);
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << loaded.error;
    }
}

TEST(IoGltfInvalid, everyValueMayBeReplacedByAnother) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["attributes"]["NORMAL"] = b.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
    b.primitive()["material"] = 0;
    b.json["materials"] = {
        {{"alphaMode", "MASK"},
         {"emissiveFactor", {0, 0, 1}},
         {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 2}}}}},
         {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 1}}, {"roughnessFactor", 0.5}}}}};
    const int at = b.addView<uint8_t>({1}), values = b.addView<float>({5, 6, 7});
    b.json["accessors"][0]["sparse"] = {{"count", 1},
                                        {"indices", {{"bufferView", at}, {"componentType", 5121}}},
                                        {"values", {{"bufferView", values}}}};
    b.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 1}}}}};
    b.json["nodes"].push_back({{"camera", 0}, {"rotation", {0, 0, 0, 1}}, {"scale", {1, 2, 3}}});
    b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
        b.addFloats({1, 0, 0, 2, 0, 0}, "VEC3");
    b.json["scenes"][0]["nodes"].push_back(1);
    const TempFolder folder;
    LoadOptions options;
    options.memory_limit_mb = 200;
    int loaded_count = 0;
    ASSERT_EQ(tryLoad(folder.write("t.gltf", b.gltf())).error, "");
    forEachOddity(Json::parse(b.gltf()), [&](const Json& changed) {
        const Loaded loaded = tryLoad(folder.write("t.gltf", changed.dump()), options);
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << loaded.error;
        EXPECT_TRUE(loaded.error.empty() || loaded.code != ErrorCode::kInternal) << loaded.error;
        loaded_count += loaded.error.empty();
    });
    EXPECT_GT(loaded_count, 50);
}

TEST(IoGltfInvalid, everyFileOfTheTestDataLoadsOrIsRefusedWithOneLine) {
    const std::string folder = testDataFolder();
    if (folder.empty()) GTEST_SKIP() << "no test data (STIPPLE_TEST_DATA)";
    int loaded_count = 0, total = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
        const std::string extension = entry.path().extension().string();
        if (extension != ".gltf" && extension != ".glb" && extension != ".ply" &&
            extension != ".obj")
            continue;
        const Loaded loaded = tryLoad(entry.path().string());
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << loaded.error;
        ++total;
        if (loaded.error.empty()) ++loaded_count;
    }
    EXPECT_GT(total, 0);
    EXPECT_GT(loaded_count, total / 4);
}

}  // namespace
}  // namespace stipple
