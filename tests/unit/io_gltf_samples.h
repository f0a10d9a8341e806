// SPDX-License-Identifier: Apache-2.0
// Small glTF documents that use much of the format, for several tests.
#pragma once

#include "io_test_support.h"

#include <OpenImageIO/imageio.h>
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>

namespace stipple {

// A PNG of `width` x 1 pixels.
inline std::string pngBytes(const std::vector<uint8_t>& pixels, int channels = 4) {
    const TempFolder folder;
    const std::string path = folder.path("p.png");
    auto out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(int(pixels.size()) / channels, 1, channels, OIIO::TypeDesc::UINT8);
    spec["oiio:UnassociatedAlpha"] = 1;
    out->open(path, spec);
    out->write_image(OIIO::TypeDesc::UINT8, pixels.data());
    out->close();
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
}

// The triangle with two joints, one morph target and a normal map in TEXCOORD_1. Joint 0 is at
// (0,0,5), joint 1 below it; corner 0 follows joint 0, the others joint 1.
inline GltfBuilder skinnedTriangle() {
    GltfBuilder b = GltfBuilder::triangle();
    Json& attributes = b.primitive()["attributes"];
    attributes["NORMAL"] = b.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
    attributes["TEXCOORD_0"] = b.addFloats({0, 1, 1, 1, 0, 0}, "VEC2");
    attributes["TEXCOORD_1"] = b.addFloats({0, 0.5f, 0.5f, 0.5f, 0, 0}, "VEC2");
    attributes["JOINTS_0"] = b.add<uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 5121);
    attributes["WEIGHTS_0"] = b.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0, 0, 0}, "VEC4");
    b.primitive()["targets"] = {{{"POSITION", b.addFloats({0, 0, 2, 0, 0, 0, 0, 0, 0}, "VEC3")}}};
    b.json["meshes"][0]["weights"] = {0.5};
    const int view = b.addView<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1,  //
                                       1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1});
    b.json["accessors"].push_back(
        {{"bufferView", view}, {"componentType", 5126}, {"count", 2}, {"type", "MAT4"}});
    b.json["skins"] = {
        {{"joints", {1, 2}}, {"inverseBindMatrices", b.json["accessors"].size() - 1}}};
    b.json["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {7, 7, 7}}},
                       {{"translation", {0, 0, 5}}, {"children", {2}}},
                       {{"translation", {0, 10, 0}}}};
    b.json["scenes"] = {{{"nodes", {0, 1}}}};
    b.primitive()["material"] = 0;
    const std::string png = pngBytes({255, 128, 128, 128, 255, 128}, 3);
    b.json["images"] = {
        {{"mimeType", "image/png"}, {"bufferView", b.addView<char>({png.begin(), png.end()})}}};
    b.json["textures"] = {{{"source", 0}}};
    b.json["materials"] = {{{"normalTexture", {{"index", 0}, {"texCoord", 1}}},
                            {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    return b;
}

// The unit square of two triangles, its buffers compressed by meshoptimizer, placed three times.
inline GltfBuilder meshoptSquare() {
    GltfBuilder b;
    const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const std::vector<uint32_t> indices = {0, 1, 2, 0, 2, 3};
    std::vector<unsigned char> vertices(meshopt_encodeVertexBufferBound(4, 12)),
        triangles(meshopt_encodeIndexBufferBound(6, 4));
    meshopt_encodeVertexVersion(0), meshopt_encodeIndexVersion(1);
    vertices.resize(
        meshopt_encodeVertexBuffer(vertices.data(), vertices.size(), positions.data(), 4, 12));
    triangles.resize(
        meshopt_encodeIndexBuffer(triangles.data(), triangles.size(), indices.data(), 6));
    const auto addCompressed = [&](const std::vector<unsigned char>& bytes, size_t count,
                                   size_t stride, const char* mode) {
        const int view = b.addView(bytes);
        Json& json = b.json["bufferViews"][view];
        Json extension = {{"buffer", 0},
                          {"byteOffset", json["byteOffset"]},
                          {"byteLength", json["byteLength"]},
                          {"byteStride", stride},
                          {"count", count},
                          {"mode", mode}};
        json = {{"buffer", 1},
                {"byteLength", count * stride},
                {"extensions", {{"EXT_meshopt_compression", extension}}}};
        return view;
    };
    const int v = addCompressed(vertices, 4, 12, "ATTRIBUTES"),
              t = addCompressed(triangles, 6, 4, "TRIANGLES");
    b.json["accessors"] = {
        {{"bufferView", v}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}},
        {{"bufferView", t}, {"componentType", 5125}, {"count", 6}, {"type", "SCALAR"}}};
    b.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}}};
    b.json["extensionsRequired"] = {"EXT_meshopt_compression"};
    const int places = b.addFloats({0, 0, 0, 2, 0, 0, 4, 0, 0}, "VEC3");
    b.json["nodes"] = {
        {{"mesh", 0},
         {"extensions",
          {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}}}};
    b.json["scenes"] = {{{"nodes", {0}}}};
    b.json["buffers"] = {
        {{"byteLength", b.bin.size()}},
        {{"byteLength", 72}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
    return b;
}

// The triangle compressed by Draco, and four coloured points.
inline GltfBuilder dracoTriangle() {
    draco::TriangleSoupMeshBuilder builder;
    builder.Start(1);
    const int position =
        builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    const std::array<std::array<float, 3>, 3> corners = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    builder.SetAttributeValuesForFace(position, draco::FaceIndex(0), corners[0].data(),
                                      corners[1].data(), corners[2].data());
    const auto mesh = builder.Finalize();
    draco::Encoder encoder;
    draco::EncoderBuffer encoded;
    encoder.EncodeMeshToBuffer(*mesh, &encoded).ok();
    GltfBuilder b = GltfBuilder::triangle();
    const int view = b.addView(std::vector<char>(encoded.data(), encoded.data() + encoded.size()));
    for (Json& accessor : b.json["accessors"]) accessor.erase("bufferView");
    b.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
        {"bufferView", view}, {"attributes", {{"POSITION", mesh->attribute(0)->unique_id()}}}};
    b.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
    b.json["meshes"][0]["primitives"].push_back(
        {{"mode", 0},
         {"attributes",
          {{"POSITION", b.addFloats({0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1}, "VEC3")},
           {"COLOR_0",
            b.add<uint8_t>({255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255},
                           "VEC4", 5121, true)}}}});
    return b;
}

}  // namespace stipple
