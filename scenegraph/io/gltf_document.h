// SPDX-License-Identifier: Apache-2.0
// An opened glTF file: the document as tinygltf has it, the bytes of its buffers, and checked
// access to both. Internal to the glTF loader.
#pragma once

#include <core/material.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/load_context.h>

#include <tiny_gltf.h>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace stipple {

struct GltfImage {
    std::string uri;  // empty: in a buffer view
    int buffer_view = -1;
};

struct GltfDocument {
    std::string name;              // as errors call the file
    std::filesystem::path folder;  // of the file
    tinygltf::Model model;         // without buffers and images
    std::vector<std::string> buffers;
    std::vector<GltfImage> images;
    std::map<int, std::string> decoded_views;  // compressed buffer views, by index
    LoadContext& context;

    // Throws Error with where "file: path".
    [[noreturn]] void fail(ErrorCode code, const std::string& path,
                           const std::string& message) const;
    // Throws kInvalidScene unless index is in [0, count); what: "materials".
    void checkIndex(int index, size_t count, const std::string& path, const char* what) const;
    std::string where(const std::string& path) const { return name + ": " + path; }
};

// Reads the container (.gltf or .glb, told apart by content), checks the JSON's types against
// gltf.schema.json, versions and extensions, and loads the buffers. Throws kFileNotFound, kParse,
// kInvalidScene, kUnsupported, kOutOfMemory.
GltfDocument openGltf(const std::filesystem::path& path, const std::string& name,
                      LoadContext& context);

// Bytes [offset, offset + length) of a buffer. Throws kInvalidScene if they are not all there.
std::string_view bufferBytes(const GltfDocument& document, int buffer, size_t offset, size_t length,
                             const std::string& path);

// The bytes of a buffer view, decoded if it is compressed. Throws kInvalidScene if they are not all
// there.
std::string_view bufferViewBytes(const GltfDocument& document, int view, const std::string& path);

// The bytes of an image, wherever they are.
std::string imageBytes(const GltfDocument& document, int image);

// Number of elements of an accessor. Throws kInvalidScene for a wrong index or a wrong type; types:
// those that are allowed (TINYGLTF_TYPE_...). path: where the accessor's index stands.
size_t accessorCount(const GltfDocument& document, int accessor, std::initializer_list<int> types,
                     const std::string& path);

// All components of an accessor of floats or (normalized) integers, sparse ones filled in: count x
// `components` values; an accessor with fewer components leaves the rest at `fill`. Throws
// kInvalidScene for data out of bounds or not finite.
std::vector<float> readFloats(const GltfDocument& document, int accessor, int components,
                              float fill, const std::string& path);

// An accessor of unsigned integer scalars.
std::vector<uint32_t> readIndices(const GltfDocument& document, int accessor,
                                  const std::string& path);

}  // namespace stipple
