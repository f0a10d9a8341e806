// SPDX-License-Identifier: Apache-2.0
// glTF files that are right: what is in them arrives in the scene.
#include <core/image.h>
#include <gtest/gtest.h>

#include <scenegraph/surface_at.h>

#include "io_test_support.h"

#include <OpenImageIO/imageio.h>

namespace stipple {
namespace {

Loaded load(GltfBuilder& builder) {
    Loaded loaded = tryLoadText("t.gltf", builder.gltf());
    EXPECT_EQ(loaded.error, "");
    return loaded;
}

// A PNG of `width` x 1 RGBA pixels.
std::string pngBytes(const std::vector<uint8_t>& rgba, int channels = 4) {
    const TempFolder folder;
    const std::string path = folder.path("p.png");
    auto out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(int(rgba.size()) / channels, 1, channels, OIIO::TypeDesc::UINT8);
    spec["oiio:UnassociatedAlpha"] = 1;
    out->open(path, spec);
    out->write_image(OIIO::TypeDesc::UINT8, rgba.data());
    out->close();
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
}

// The triangle, textured with that picture.
GltfBuilder texturedTriangle(const std::string& png) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["attributes"]["TEXCOORD_0"] = b.addFloats({0, 0, 1, 0, 0, 1}, "VEC2");
    b.primitive()["material"] = 0;
    b.json["images"] = {{{"uri", "data:image/png;base64," + base64(png)}}};
    b.json["textures"] = {{{"source", 0}}};
    b.json["materials"] = {
        {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}}}};
    return b;
}

const Mesh& meshOf(const Loaded& loaded) { return loaded.scene.meshes.at(0); }

// Positions of the triangle's corners, in order.
std::vector<Vec3> corners(const Mesh& mesh, size_t triangle) {
    const UVec3 t = mesh.triangles.at(triangle);
    return {mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]};
}

TEST(IoGltf, loadsATriangleFromTextAndBinary) {
    for (const bool binary : {false, true}) {
        GltfBuilder b = GltfBuilder::triangle();
        const Loaded loaded =
            binary ? tryLoadText("t.glb", b.glb()) : tryLoadText("t.gltf", b.gltf());
        ASSERT_EQ(loaded.error, "");
        const Scene& scene = loaded.scene;
        ASSERT_EQ(scene.meshes.size(), 1u);
        EXPECT_EQ(meshOf(loaded).triangles.size(), 1u);
        EXPECT_TRUE(meshOf(loaded).normals.empty());
        EXPECT_NEAR(meshOf(loaded).area, 0.5, 1e-6);
        EXPECT_EQ(scene.groups.at(scene.root).instances.size(), 1u);
        ASSERT_EQ(scene.cameras.size(), 1u);
        EXPECT_EQ(scene.cameras[0].name, "default");
        EXPECT_EQ(scene.lighting.suns.size(), 1u);
        EXPECT_TRUE(loaded.diagnostics.warnings.empty());
    }
}

TEST(IoGltf, anUntransformedSingleMeshIsReturnedAsSuch) {
    const TempFolder folder;
    GltfBuilder b = GltfBuilder::triangle();
    Scene scene;
    Diagnostics diagnostics;
    const ChildRef plain = loadGltf(folder.write("a.gltf", b.gltf()), scene, {}, diagnostics);
    EXPECT_FALSE(plain.isGroup());
    b.json["nodes"][0]["translation"] = {1, 0, 0};
    const ChildRef moved = loadGltf(folder.write("b.gltf", b.gltf()), scene, {}, diagnostics);
    EXPECT_TRUE(moved.isGroup());
    EXPECT_EQ(scene.meshes.size(), 2u);
}

TEST(IoGltf, readsExternalBuffersWithEscapedAndUnicodeNames) {
    const TempFolder folder;
    GltfBuilder b = GltfBuilder::triangle();
    folder.write("data/p\xc5\x99\xc3\xad +vod.bin", b.bin + "trailing bytes are allowed");
    b.json["buffers"] = {
        {{"byteLength", b.bin.size()}, {"uri", "data/p%C5%99\xc3\xad%20+vod.bin"}}};
    EXPECT_EQ(tryLoad(folder.write("\xc5\xa1.gltf", b.gltf())).error, "");
}

TEST(IoGltf, readsAllIndexTypesAndNone) {
    for (int type : {5121, 5123, 5125, 0}) {
        GltfBuilder b = GltfBuilder::triangle();
        if (type == 5121) b.primitive()["indices"] = b.add<uint8_t>({0, 2, 1}, "SCALAR", type);
        if (type == 5123) b.primitive()["indices"] = b.add<uint16_t>({0, 2, 1}, "SCALAR", type);
        if (type == 5125) b.primitive()["indices"] = b.add<uint32_t>({0, 2, 1}, "SCALAR", type);
        if (type == 0) b.primitive().erase("indices");
        const Loaded loaded = load(b);
        EXPECT_EQ(corners(meshOf(loaded), 0)[1], type ? Vec3(0, 1, 0) : Vec3(1, 0, 0)) << type;
    }
}

TEST(IoGltf, readsQuantizedPositionsOfAllTypes) {
    const auto secondCorner = [](GltfBuilder& b, int accessor) {
        b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_mesh_quantization"};
        b.primitive()["attributes"]["POSITION"] = accessor;
        return corners(meshOf(load(b)), 0)[1];
    };
    GltfBuilder b = GltfBuilder::triangle();
    EXPECT_EQ(secondCorner(b, b.add<int8_t>({0, 0, 0, 7, 0, 0, 0, 9, 0}, "VEC3", 5120)),
              Vec3(7, 0, 0));
    EXPECT_EQ(secondCorner(b, b.add<int8_t>({0, 0, 0, -128, 0, 0, 0, 9, 0}, "VEC3", 5120, true)),
              Vec3(-1, 0, 0));
    EXPECT_EQ(secondCorner(b, b.add<uint8_t>({0, 0, 0, 255, 0, 0, 0, 9, 0}, "VEC3", 5121, true)),
              Vec3(1, 0, 0));
    EXPECT_EQ(secondCorner(b, b.add<int16_t>({0, 0, 0, -300, 0, 0, 0, 9, 0}, "VEC3", 5122)),
              Vec3(-300, 0, 0));
    EXPECT_EQ(secondCorner(b, b.add<uint16_t>({0, 0, 0, 65535, 0, 0, 0, 9, 0}, "VEC3", 5123, true)),
              Vec3(1, 0, 0));
}

TEST(IoGltf, readsInterleavedAttributes) {
    GltfBuilder b = GltfBuilder::triangle();
    // position, normal, position, normal, ...
    const int view = b.addView<float>({0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 2, 0, 1, 0, 0, 0, 2});
    b.json["bufferViews"][view]["byteStride"] = 24;
    for (int i = 0; i < 2; ++i) {
        b.json["accessors"].push_back({{"bufferView", view},
                                       {"byteOffset", 12 * i},
                                       {"componentType", 5126},
                                       {"count", 3},
                                       {"type", "VEC3"}});
        b.primitive()["attributes"][i ? "NORMAL" : "POSITION"] = b.json["accessors"].size() - 1;
    }
    const Loaded loaded = load(b);
    EXPECT_EQ(corners(meshOf(loaded), 0)[2], Vec3(0, 1, 0));
    ASSERT_EQ(meshOf(loaded).normals.size(), 3u);
    EXPECT_EQ(meshOf(loaded).normals[1], Vec3(0, 0, 1));
}

TEST(IoGltf, fillsInSparseAccessors) {
    GltfBuilder b = GltfBuilder::triangle();
    const int indices = b.addView<uint8_t>({1}), values = b.addView<float>({5, 6, 7});
    const Json sparse = {{"count", 1},
                         {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                         {"values", {{"bufferView", values}}}};
    b.json["accessors"][0]["sparse"] = sparse;
    EXPECT_EQ(corners(meshOf(load(b)), 0)[1], Vec3(5, 6, 7));
    // Without a buffer view the others are zero.
    GltfBuilder c = GltfBuilder::triangle();
    const int three = c.addView<uint16_t>({0, 1, 2}),
              all = c.addView<float>({1, 1, 1, 2, 1, 1, 1, 2, 1});
    c.json["accessors"][0].erase("bufferView");
    c.json["accessors"][0]["sparse"] = {
        {"count", 3},
        {"indices", {{"bufferView", three}, {"componentType", 5123}}},
        {"values", {{"bufferView", all}}}};
    EXPECT_EQ(corners(meshOf(load(c)), 0)[1], Vec3(2, 1, 1));
}

TEST(IoGltf, assemblesStripsAndFansWithOneOrientation) {
    // A unit square: all triangles face +z, whatever the mode.
    GltfBuilder b = GltfBuilder::triangle();
    const int strip = b.addFloats({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, "VEC3");
    const int fan = b.addFloats({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
    b.primitive().erase("indices");
    for (const auto& [mode, accessor] : {std::pair(5, strip), std::pair(6, fan)}) {
        b.primitive()["mode"] = mode;
        b.primitive()["attributes"]["POSITION"] = accessor;
        const Loaded loaded = load(b);
        ASSERT_EQ(meshOf(loaded).triangles.size(), 2u);
        for (size_t t = 0; t < 2; ++t) {
            const auto c = corners(meshOf(loaded), t);
            EXPECT_GT(glm::cross(c[1] - c[0], c[2] - c[0]).z, 0.0f) << "mode " << mode;
        }
        EXPECT_NEAR(meshOf(loaded).area, 1.0, 1e-6);
    }
}

// As clouds of PLY files, which builders take by their points; not where there are triangles, too.
TEST(IoGltf, meshesOfNothingButPointsAreClouds) {
    GltfBuilder b = GltfBuilder::triangle();
    Json points = b.primitive();
    points["mode"] = 0;
    points.erase("indices");
    b.json["meshes"][0]["primitives"].push_back(points);
    EXPECT_FALSE(meshOf(load(b)).is_cloud);
    b.json["meshes"][0]["primitives"][0] = points;
    points["attributes"]["POSITION"] = b.addFloats({5, 0, 0, 5, 1, 0, 5, 0, 1}, "VEC3");
    b.json["meshes"][0]["primitives"][1] = points;
    const Loaded loaded = load(b);
    EXPECT_TRUE(meshOf(loaded).is_cloud);
    EXPECT_EQ(meshOf(loaded).positions.size(), 24u);
}

TEST(IoGltf, skipsLinesWithOneWarning) {
    GltfBuilder b = GltfBuilder::triangle();
    for (int mode : {1, 2, 3}) {
        Json p = b.primitive();
        p["mode"] = mode;
        b.json["meshes"][0]["primitives"].push_back(p);
    }
    const Loaded loaded = load(b);
    EXPECT_EQ(meshOf(loaded).triangles.size(), 1u);
    EXPECT_EQ(loaded.diagnostics.warnings.size(), 1u);
}

TEST(IoGltf, givesFlatNormalsToPrimitivesThatLackThemIfOthersHaveThem) {
    GltfBuilder b = GltfBuilder::triangle();
    Json with_normals = b.primitive();
    with_normals["attributes"]["NORMAL"] = b.addFloats({1, 0, 0, 1, 0, 0, 0, 0, 0}, "VEC3");
    b.json["meshes"][0]["primitives"].push_back(with_normals);
    const Loaded loaded = load(b);
    const Mesh& mesh = meshOf(loaded);
    ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
    ASSERT_EQ(mesh.positions.size(), 6u);
    EXPECT_EQ(mesh.normals[0], Vec3(0, 0, 1));
    EXPECT_EQ(mesh.normals[3], Vec3(1, 0, 0));
    EXPECT_EQ(mesh.normals[5], Vec3(0, 0, 1));  // a null vector gives way to the face's normal
}

TEST(IoGltf, vertexColoursOfThreeComponentsAreOpaqueAndOthersWhite) {
    GltfBuilder b = GltfBuilder::triangle();
    Json coloured = b.primitive();
    coloured["attributes"]["COLOR_0"] =
        b.add<uint8_t>({255, 0, 51, 0, 255, 0, 0, 0, 255}, "VEC3", 5121, true);
    b.json["meshes"][0]["primitives"].push_back(coloured);
    const Loaded loaded = load(b);
    const Mesh& mesh = meshOf(loaded);
    ASSERT_EQ(mesh.colors.size(), 6u);
    EXPECT_EQ(mesh.colors[0], Vec4(1));
    EXPECT_NEAR(mesh.colors[3].b, 0.2f, 1e-6f);
    EXPECT_EQ(mesh.colors[3].a, 1.0f);
}

TEST(IoGltf, composesNestedTransforms) {
    GltfBuilder b = GltfBuilder::triangle();
    const double h = std::sqrt(0.5);
    b.json["nodes"] = {
        {{"translation", {10, 0, 0}}, {"rotation", {0, 0, h, h}}, {"children", {1}}},
        {{"matrix", {2, 0, 0, 0, 0, 3, 0, 0, 0, 0, -1, 0, 1, 2, 3, 1}}, {"mesh", 0}}};
    const Loaded loaded = load(b);
    const Group& root = loaded.scene.groups[loaded.scene.root];
    ASSERT_EQ(root.instances.size(), 1u);
    const DVec3 p = root.instances.groupFromChild(0).point(DVec3(1, 1, 1));
    // The matrix: (3, 5, 2); a quarter turn about z: (-5, 3, 2).
    EXPECT_NEAR(p.x, 5, 1e-6);
    EXPECT_NEAR(p.y, 3, 1e-6);
    EXPECT_NEAR(p.z, 2, 1e-6);
    EXPECT_LT(glm::determinant(root.instances.groupFromChild(0).linear), 0.0);
}

TEST(IoGltf, choosesTheDefaultSceneOrTheFirstOrAllRoots) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"children", {2}}}, {{"mesh", 0}}};
    b.json["scenes"] = {{{"nodes", {0}}}, {{"nodes", {0, 1}}}};
    b.json["scene"] = 1;
    const auto instances = [&] {
        const Loaded loaded = load(b);
        return loaded.scene.groups[loaded.scene.root].instances.size();
    };
    EXPECT_EQ(instances(), 3u);
    b.json.erase("scene");
    EXPECT_EQ(instances(), 1u);
    b.json.erase("scenes");
    EXPECT_EQ(instances(), 3u);
}

TEST(IoGltf, sharesMeshesOfNodesAndNodesOfSeveralParents) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = {{{"children", {2}}, {"translation", {1, 0, 0}}},
                       {{"children", {2}}, {"scale", {2, 2, 2}}},
                       {{"mesh", 0}}};
    b.json["scenes"][0]["nodes"] = {0, 1};
    const Loaded loaded = load(b);
    EXPECT_EQ(loaded.scene.meshes.size(), 1u);
    EXPECT_EQ(loaded.scene.groups[loaded.scene.root].instances.size(), 2u);
}

TEST(IoGltf, leavesOutWhatIsScaledToNothing) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"scale", {0, 1, 1}}}};
    b.json["scenes"][0]["nodes"] = {0, 1};
    const Loaded loaded = load(b);
    EXPECT_EQ(loaded.scene.groups[loaded.scene.root].instances.size(), 1u);
    EXPECT_EQ(loaded.diagnostics.warnings.size(), 1u);
}

TEST(IoGltf, placesGpuInstances) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
    b.json["nodes"][0]["translation"] = {0, 0, 100};
    const int t = b.addFloats({1, 0, 0, 2, 0, 0}, "VEC3");
    const int r = b.add<int8_t>({0, 0, 127, 0, 0, 0, 0, 127}, "VEC4", 5120, true);
    const int s = b.addFloats({2, 2, 2, 1, 3, 1}, "VEC3");
    b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", t}, {"ROTATION", r}, {"SCALE", s}};
    const Loaded loaded = load(b);
    const Group& root = loaded.scene.groups[loaded.scene.root];
    ASSERT_EQ(root.instances.size(), 2u);
    DBox3 points;
    for (size_t i = 0; i < 2; ++i)
        points.extend(root.instances.groupFromChild(i).point(DVec3(1, 1, 0)));
    // Half a turn about z and scale 2 at x = 1: (-1, -2); scale (1, 3, 1) at x = 2: (3, 3).
    EXPECT_NEAR(points.min.x, -1, 1e-5);
    EXPECT_NEAR(points.min.y, -2, 1e-5);
    EXPECT_NEAR(points.max.x, 3, 1e-5);
    EXPECT_NEAR(points.max.y, 3, 1e-5);
    EXPECT_NEAR(points.min.z, 100, 1e-5);
}

TEST(IoGltf, readsTheMaterialsValues) {
    GltfBuilder b = GltfBuilder::triangle();
    b.primitive()["material"] = 0;
    b.json["materials"] = {
        {{"name", "m"},
         {"alphaMode", "MASK"},
         {"alphaCutoff", 0.25},
         {"doubleSided", true},
         {"emissiveFactor", {0.5, 0, 1}},
         {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}}},
         {"pbrMetallicRoughness",
          {{"baseColorFactor", {0.8, 0.4, 0.2, 0.5}},
           {"metallicFactor", 0.25},
           {"roughnessFactor", 0.5}}}}};
    const Material m = load(b).scene.materials.at(0);
    EXPECT_EQ(m.base_color.r, 0.8f);
    EXPECT_EQ(m.metallic, 0.25f);
    EXPECT_EQ(m.roughness, 0.5f);
    EXPECT_EQ(m.specular.g, 0.04f);
    EXPECT_EQ(m.specular_weight, 1.0f);
    EXPECT_EQ(m.alpha, 0.5f);
    EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
    EXPECT_EQ(m.alpha_cutoff, 0.25f);
    EXPECT_TRUE(m.double_sided);
    EXPECT_EQ(m.emissive, Vec3(2, 0, 4));
    EXPECT_FALSE(m.unlit);
    b.json["materials"][0]["extensions"] = {{"KHR_materials_unlit", Json::object()}};
    b.json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 0;
    const Material unlit = load(b).scene.materials.at(0);
    EXPECT_TRUE(unlit.unlit);
    EXPECT_NEAR(unlit.base_color.r, 0.8f, 1e-6f);
    b.json["materials"][0].erase("extensions");
    EXPECT_EQ(load(b).scene.materials.at(0).roughness, 0.0f);
}

TEST(IoGltf, loadsBaseTexturesWithTheirSampler) {
    GltfBuilder b = texturedTriangle(pngBytes({255, 0, 0, 255, 0, 255, 0, 0}));
    b.json["samplers"] = {{{"magFilter", 9728}, {"wrapS", 33071}, {"wrapT", 33648}}};
    b.json["textures"][0]["sampler"] = 0;
    b.json["materials"][0]["alphaMode"] = "MASK";
    Loaded loaded = load(b);
    ASSERT_EQ(loaded.scene.textures.size(), 1u);
    const Texture& t = loaded.scene.textures[0];
    EXPECT_EQ(loaded.scene.materials[0].base_texture, 0);
    EXPECT_EQ(t.wrap_u, Wrap::kClamp);
    EXPECT_EQ(t.wrap_v, Wrap::kMirror);
    EXPECT_TRUE(t.nearest);
    EXPECT_EQ(t.levels.size(), 2u);
    EXPECT_EQ(t.levels[0].rgba, (std::vector<uint8_t>{255, 0, 0, 255, 0, 255, 0, 0}));
    // An opaque material's texture has no holes.
    b.json["materials"][0]["alphaMode"] = "OPAQUE";
    loaded = load(b);
    EXPECT_EQ(loaded.scene.textures[0].levels[0].rgba[7], 255);
}

TEST(IoGltf, expandsGreyPictures) {
    GltfBuilder b = texturedTriangle(pngBytes({10, 200}, 1));
    EXPECT_EQ(load(b).scene.textures[0].levels[0].rgba,
              (std::vector<uint8_t>{10, 10, 10, 255, 200, 200, 200, 255}));
}

TEST(IoGltf, readsPicturesFromFilesAndBufferViews) {
    const std::string png = pngBytes({1, 2, 3, 255});
    GltfBuilder b = texturedTriangle(png);
    b.json["images"][0] = {{"bufferView", b.addView(std::vector<char>(png.begin(), png.end()))},
                           {"mimeType", "image/png"}};
    EXPECT_EQ(tryLoadText("t.glb", b.glb()).error, "");
    const TempFolder folder;
    folder.write("textures/leaf 1.png", png);
    b.json["images"][0] = {{"uri", "textures/leaf%201.png"}};
    EXPECT_EQ(tryLoad(folder.write("t.gltf", b.gltf())).error, "");
}

TEST(IoGltf, metalnessRoughnessAndEmissionVaryOverTheSurface) {
    GltfBuilder b = texturedTriangle(pngBytes({0, 51, 0, 255, 0, 255, 255, 255}));
    b.json["materials"][0]["pbrMetallicRoughness"] = {{"metallicRoughnessTexture", {{"index", 0}}},
                                                      {"roughnessFactor", 0.5}};
    b.json["materials"][0]["emissiveFactor"] = {1, 0.5, 1};
    b.json["materials"][0]["emissiveTexture"] = {{"index", 0}};
    const Loaded loaded = load(b);
    const auto finishAt = [&](float u, float width) {
        const LookupBeam beam{width, Vec3(0, 0, -1)};
        return surfaceAt(meshOf(loaded), loaded.scene.materials, loaded.scene.textures, 0, u, 0,
                         beam)
            .finish;
    };
    const SurfaceFinish left = finishAt(0.25f, 0.0f), right = finishAt(0.75f, 0.0f);
    EXPECT_NEAR(left.metallic, 0.0f, 1e-5f);
    EXPECT_NEAR(left.roughness, 0.1f, 1e-5f);
    EXPECT_NEAR(left.emissive.g, 0.5f * linearFromSrgb(0.2f), 1e-5f);
    EXPECT_NEAR(right.metallic, 1.0f, 1e-5f);
    EXPECT_NEAR(right.roughness, 0.5f, 1e-5f);
    EXPECT_NEAR(right.emissive.g, 0.5f, 1e-5f);
    EXPECT_EQ(right.emissive.r, 0.0f);
    // From afar it is what both texels are together.
    EXPECT_NEAR(finishAt(0.25f, 10.0f).roughness, 0.3f, 2e-3f);
    EXPECT_NEAR(finishAt(0.25f, 10.0f).metallic, 0.5f, 2e-3f);
}

TEST(IoGltf, bakesTextureTransformsIntoUvs) {
    GltfBuilder b = texturedTriangle(pngBytes({1, 2, 3, 255}));
    b.primitive()["attributes"]["TEXCOORD_1"] = b.addFloats({1, 0, 0, 1, 1, 1}, "VEC2");
    b.json["extensionsUsed"] = {"KHR_texture_transform"};
    // The lower left quarter of the picture, turned clockwise by 90 degrees (the specification's
    // example).
    b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]
          ["KHR_texture_transform"] = {
        {"offset", {0, 1}}, {"rotation", kPi / 2}, {"scale", {0.5, 0.5}}, {"texCoord", 1}};
    const Loaded loaded = load(b);
    const auto& uvs = meshOf(loaded).uvs;
    ASSERT_EQ(uvs.size(), 3u);
    EXPECT_NEAR(uvs[0].x, 0.0f, 1e-6f);
    EXPECT_NEAR(uvs[0].y, 0.5f, 1e-6f);
    EXPECT_NEAR(uvs[1].x, 0.5f, 1e-6f);
    EXPECT_NEAR(uvs[1].y, 1.0f, 1e-6f);
    EXPECT_NEAR(uvs[2].x, 0.5f, 1e-6f);
    EXPECT_NEAR(uvs[2].y, 0.5f, 1e-6f);
}

TEST(IoGltf, addsCamerasAndDirectionalLights) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["cameras"] = {{{"type", "perspective"},
                          {"name", "eye"},
                          {"perspective", {{"yfov", 0.5}, {"znear", 0.1}, {"zfar", 50}}}},
                         {{"type", "orthographic"},
                          {"orthographic", {{"xmag", 2}, {"ymag", 3}, {"znear", 1}, {"zfar", 9}}}}};
    const double h = std::sqrt(0.5);
    // Turned by 90 degrees about y: looks along -x.
    b.json["nodes"] = {
        {{"mesh", 0}},
        {{"camera", 0}, {"translation", {1, 2, 3}}, {"rotation", {0, h, 0, h}}},
        {{"camera", 1}, {"name", "top"}},
        {{"camera", 0}},
        {{"rotation", {0, h, 0, h}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}}};
    b.json["scenes"][0]["nodes"] = {0, 1, 2, 3, 4};
    b.json["extensionsUsed"] = {"KHR_lights_punctual"};
    b.json["extensions"]["KHR_lights_punctual"]["lights"] = {
        {{"type", "directional"}, {"color", {1, 0.5, 0}}, {"intensity", 2}}};
    const Loaded loaded = load(b);
    const auto& cameras = loaded.scene.cameras;
    ASSERT_EQ(cameras.size(), 4u);
    EXPECT_EQ(cameras[0].name, "default");
    const Camera* eye = loaded.scene.findCamera("eye");
    ASSERT_TRUE(eye);
    EXPECT_NEAR(glm::length(eye->world_from_camera[2] - DVec3(-1, 0, 0)), 0.0, 1e-9);
    EXPECT_NEAR(glm::length(eye->world_from_camera[1] - DVec3(0, -1, 0)), 0.0, 1e-9);
    EXPECT_NEAR(glm::length(eye->eye - DVec3(1, 2, 3)), 0.0, 1e-12);
    EXPECT_EQ(eye->fov_y, 0.5);
    EXPECT_EQ(eye->far_z, 50.0);
    EXPECT_TRUE(loaded.scene.findCamera("eye 2"));
    const Camera* top = loaded.scene.findCamera("top");
    ASSERT_TRUE(top);
    EXPECT_TRUE(top->orthographic);
    EXPECT_EQ(top->height, 6.0);
    ASSERT_EQ(loaded.scene.lighting.suns.size(), 1u);
    EXPECT_NEAR(glm::length(loaded.scene.lighting.suns[0].direction_to_light - Vec3(1, 0, 0)), 0.0f,
                1e-6f);
    EXPECT_NEAR(loaded.scene.lighting.suns[0].irradiance.g, 1.0f, 1e-6f);
}

TEST(IoGltf, readsPointAndSpotLightsWhereTheirNodesStand) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["extensions"]["KHR_lights_punctual"]["lights"] = {
        {{"type", "point"}, {"color", {1, 0.5, 0}}, {"intensity", 40}, {"range", 9}},
        {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.2}, {"outerConeAngle", 0.5}}}}};
    const auto lightNode = [](int light) {
        return Json{{"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}};
    };
    b.json["nodes"].push_back(lightNode(0));
    b.json["nodes"].push_back(lightNode(1));
    b.json["nodes"][2]["translation"] = {0, 1, 0};
    // The lights hang below a node that turns x to -z, moves and scales.
    const double h = std::sqrt(0.5);
    b.json["nodes"].push_back({{"children", {1, 2}},
                               {"translation", {5, 0, 0}},
                               {"rotation", {0, h, 0, h}},
                               {"scale", {2, 2, 2}}});
    b.json["scenes"][0]["nodes"].push_back(3);
    const Loaded loaded = load(b);
    ASSERT_EQ(loaded.error, "");
    const std::vector<PointLight>& points = loaded.scene.lighting.points;
    ASSERT_EQ(points.size(), 2u);
    EXPECT_TRUE(loaded.scene.lighting.suns.empty());
    EXPECT_LT(glm::length(points[0].position - DVec3(5, 0, 0)), 1e-9);
    EXPECT_EQ(points[0].intensity, Vec3(40, 20, 0));
    EXPECT_EQ(points[0].range, 9.0f);
    EXPECT_FALSE(points[0].is_spot);
    EXPECT_TRUE(points[1].is_spot);
    EXPECT_LT(glm::length(points[1].position - DVec3(5, 2, 0)), 1e-9);
    EXPECT_LT(glm::length(points[1].axis - Vec3(-1, 0, 0)), 1e-6f);
    EXPECT_EQ(points[1].inner_cone, 0.2f);
    EXPECT_EQ(points[1].intensity, Vec3(1.0f));
    b.json["extensions"]["KHR_lights_punctual"]["lights"][1]["spot"]["innerConeAngle"] = 0.6;
    EXPECT_NE(tryLoadText("t.gltf", b.gltf()).error.find("lights[1].spot: the cone's angles"),
              std::string::npos);
}

TEST(IoGltf, warnsOnceOfExtensionsItDoesNotKnow) {
    GltfBuilder b = GltfBuilder::triangle();
    b.json["extensionsUsed"] = {"KHR_materials_clearcoat", "KHR_mesh_quantization"};
    const Loaded loaded = load(b);
    ASSERT_EQ(loaded.diagnostics.warnings.size(), 1u);
    EXPECT_NE(loaded.diagnostics.warnings[0].find("\"KHR_materials_clearcoat\" is ignored"),
              std::string::npos);
}

}  // namespace
}  // namespace stipple
