// SPDX-License-Identifier: Apache-2.0
// The container of a glTF file and its buffers.
// why: tinygltf only turns JSON into structs here. It would read files outside of the folder, take
// other lengths than the specification allows for wrong, drop what has a wrong type without a word,
// and read beyond the end of a cut-off .glb.
// why: compiled in here, as Draco's library exports an older tinygltf of its own, which would take
// the place of a shared one.
#define TINYGLTF_IMPLEMENTATION
#include <scenegraph/io/gltf_document.h>

#include <scenegraph/io/gltf_compression.h>
#include <scenegraph/io/schemas.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

namespace stipple {

namespace {

constexpr std::array kSupportedExtensions = {"EXT_mesh_gpu_instancing",
                                             "EXT_meshopt_compression",
                                             "EXT_texture_webp",
                                             "KHR_materials_diffuse_transmission",
                                             "KHR_draco_mesh_compression",
                                             "KHR_lights_punctual",
                                             "KHR_materials_emissive_strength",
                                             "KHR_materials_specular",
                                             "KHR_materials_unlit",
                                             "KHR_mesh_quantization",
                                             "KHR_texture_transform"};

struct Container {
    std::string_view json;
    std::string_view binary;  // the BIN chunk
    bool is_glb = false;
};

uint32_t readWord(std::string_view bytes, size_t at) {
    uint32_t word = 0;
    for (int i = 3; i >= 0; --i) word = word << 8 | uint8_t(bytes[at + i]);
    return word;
}

// Finds the chunks of a .glb; anything else is taken for the JSON of a .gltf.
Container splitContainer(std::string_view bytes, const std::string& name) {
    if (!bytes.starts_with("glTF")) return {bytes, {}, false};
    const auto fail = [&](const std::string& message) {
        throw Error(ErrorCode::kParse, name, message);
    };
    constexpr size_t kHeader = 12, kChunkHeader = 8;
    constexpr uint32_t kJson = 0x4e4f534a, kBin = 0x004e4942;
    if (bytes.size() < kHeader) fail("cut off: a .glb has at least 12 bytes");
    const uint32_t version = readWord(bytes, 4), length = readWord(bytes, 8);
    if (version != 2)
        throw Error(ErrorCode::kUnsupported, name,
                    "binary glTF of version " + std::to_string(version) + ", not 2");
    if (length > bytes.size()) {
        fail("cut off: the header says " + std::to_string(length) + " bytes, the file has " +
             std::to_string(bytes.size()));
    }
    Container container{{}, {}, true};
    bool has_json = false, has_binary = false;
    for (size_t at = kHeader; at < length;) {
        if (length - at < kChunkHeader)
            fail("cut off within the header of a chunk at byte " + std::to_string(at));
        const size_t size = readWord(bytes, at);
        const uint32_t type = readWord(bytes, at + 4);
        at += kChunkHeader;
        if (size > length - at) {
            fail("chunk at byte " + std::to_string(at - kChunkHeader) + " has " +
                 std::to_string(size) + " bytes, but only " + std::to_string(length - at) +
                 " follow");
        }
        if (!has_json) {
            if (type != kJson) fail("the first chunk is not JSON");
            container.json = bytes.substr(at, size);
            has_json = true;
        } else if (type == kBin && !has_binary) {
            container.binary = bytes.substr(at, size);
            has_binary = true;
        }
        at += size;
    }
    if (!has_json) fail("has no JSON chunk");
    return container;
}

// "%C5%99" as the bytes it stands for. Anything that is no escape stays.
std::string percentDecoded(const std::string& uri) {
    const auto hex = [](char c) {
        return c >= '0' && c <= '9'                 ? c - '0'
               : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10
                                                    : -1;
    };
    std::string text;
    for (size_t i = 0; i < uri.size(); ++i) {
        if (uri[i] == '%' && i + 2 < uri.size() && hex(uri[i + 1]) >= 0 && hex(uri[i + 2]) >= 0) {
            text += char(hex(uri[i + 1]) * 16 + hex(uri[i + 2]));
            i += 2;
        } else {
            text += uri[i];
        }
    }
    return text;
}

// The payload of a data URI (base64 only).
std::string decodeDataUri(const GltfDocument& document, const std::string& uri,
                          const std::string& path) {
    const size_t comma = uri.find(',');
    if (comma == std::string::npos ||
        !std::string_view(uri).substr(0, comma).ends_with(";base64")) {
        document.fail(ErrorCode::kUnsupported, path, "data URI that is not base64");
    }
    const size_t padding = uri.ends_with("==") ? 2 : uri.ends_with('=') ? 1 : 0;
    const std::string payload = uri.substr(comma + 1);
    if (payload.empty()) return {};
    document.context.budget.require(4.0 * double(payload.size()), document.where(path),
                                    "the data URI's bytes");
    std::vector<unsigned char> bytes;
    std::string mime;
    // tinygltf knows a few media types only, but decodes all of them alike.
    if (!tinygltf::DecodeDataURI(&bytes, mime, "data:application/octet-stream;base64," + payload, 0,
                                 false) ||
        bytes.size() != (payload.size() - padding) * 3 / 4) {
        document.fail(ErrorCode::kParse, path, "data URI with characters that are not base64");
    }
    return std::string(bytes.begin(), bytes.end());
}

std::string bytesOfUri(const GltfDocument& document, const std::string& uri,
                       const std::string& path) {
    if (uri.starts_with("data:")) return decodeDataUri(document, uri, path);
    if (const size_t scheme = uri.find("://"); scheme != std::string::npos && scheme < 16) {
        document.fail(ErrorCode::kUnsupported, path,
                      "URI " + inQuotes(uri) + " is not a file beside this one");
    }
    const std::string relative = percentDecoded(uri), where = document.where(path);
    return readFile(resolvePath(document.context, document.folder, relative, where),
                    document.context.budget, where + ": " + inQuotes(relative));
}

void checkVersion(const GltfDocument& document, const Json& asset) {
    const auto text = [&](const char* key) {
        return asset.contains(key) ? asset[key].get<std::string>() : "";
    };
    const std::string version = text("version"), least = text("minVersion");
    if (version != "2" && !version.starts_with("2.")) {
        document.fail(ErrorCode::kUnsupported, "asset.version",
                      "glTF " + oneLine(version, 20) + " is not supported, only 2.x");
    }
    if (!least.empty() && least != "2.0" && least != "2.1") {
        document.fail(ErrorCode::kUnsupported, "asset.minVersion",
                      "needs glTF " + oneLine(least, 20));
    }
}

void checkExtensions(const GltfDocument& document, const Json& root) {
    const auto isSupported = [](const std::string& name) {
        return std::find(kSupportedExtensions.begin(), kSupportedExtensions.end(), name) !=
               kSupportedExtensions.end();
    };
    const Json none = Json::array();
    const auto list = [&](const char* key) { return root.contains(key) ? root[key] : none; };
    for (const std::string name : list("extensionsRequired")) {
        if (!isSupported(name)) {
            document.fail(ErrorCode::kUnsupported, "extensionsRequired",
                          inQuotes(name) + " is not supported");
        }
    }
    for (const std::string name : list("extensionsUsed")) {
        if (!isSupported(name))
            document.context.warnOnce(document.name, "extension " + inQuotes(name) + " is ignored");
    }
}

// A buffer that only readers without EXT_meshopt_compression need.
bool isFallback(const Json& buffer) {
    const auto place = Json::json_pointer("/extensions/EXT_meshopt_compression/fallback");
    return buffer.contains(place) && buffer[place].get<bool>();
}

void loadBuffers(GltfDocument& document, const Json& buffers, const Container& container) {
    for (size_t i = 0; i < buffers.size(); ++i) {
        const std::string path = "buffers[" + std::to_string(i) + "]";
        const size_t length = buffers[i].at("byteLength").get<size_t>();
        std::string bytes;
        if (buffers[i].contains("uri")) {
            bytes = bytesOfUri(document, buffers[i].at("uri").get_ref<const std::string&>(),
                               path + ".uri");
        } else if (container.is_glb && i == 0) {
            document.context.budget.require(double(container.binary.size()), document.where(path),
                                            "the buffer's bytes");
            bytes = std::string(container.binary);
        } else if (isFallback(buffers[i])) {  // read by nothing that knows the extension
            document.buffers.emplace_back();
            continue;
        } else if (length) {
            document.fail(ErrorCode::kInvalidScene, path,
                          "has no uri, and there is no BIN chunk for it");
        }
        if (bytes.size() < length) {
            document.fail(ErrorCode::kInvalidScene, path + ".byteLength",
                          std::to_string(length) + " > the " + std::to_string(bytes.size()) +
                              " bytes that are there");
        }
        bytes.resize(length);
        document.context.budget.take(double(length), document.where(path), "the buffer's bytes");
        document.buffers.push_back(std::move(bytes));
    }
}

// Array `key` of the document, taken out of it.
Json takeArray(Json& root, const char* key) {
    Json array = Json::array();
    if (const auto it = root.find(key); it != root.end()) {
        array = std::move(*it);
        root.erase(it);
    }
    return array;
}

// Takes the indices out of all primitives: tinygltf refuses those without a buffer view, which
// compressed ones have not.
std::vector<int> takeIndices(Json& root) {
    std::vector<int> indices;
    if (!root.contains("meshes")) return indices;
    for (Json& mesh : root["meshes"]) {
        for (Json& primitive : mesh["primitives"]) {
            indices.push_back(primitive.value("indices", -1));
            primitive.erase("indices");
        }
    }
    return indices;
}

void putIndices(const std::vector<int>& indices, tinygltf::Model& model) {
    size_t i = 0;
    for (tinygltf::Mesh& mesh : model.meshes) {
        for (tinygltf::Primitive& primitive : mesh.primitives) primitive.indices = indices.at(i++);
    }
}

}  // namespace

void GltfDocument::fail(ErrorCode code, const std::string& path, const std::string& message) const {
    throw Error(code, where(path), message);
}

void GltfDocument::checkIndex(int index, size_t count, const std::string& path,
                              const char* what) const {
    if (index >= 0 && size_t(index) < count) return;
    fail(
        ErrorCode::kInvalidScene, path,
        "index " + std::to_string(index) + ", but there are " + std::to_string(count) + " " + what);
}

GltfDocument openGltf(const std::filesystem::path& path, const std::string& name,
                      LoadContext& context) {
    GltfDocument document{oneLine(name, 300), folderOf(path.string()), {}, {}, {}, {}, context};
    const std::string file = readFile(path, context.budget, document.name);
    const Container container = splitContainer(file, document.name);
    context.budget.require(10.0 * double(container.json.size()), document.name,
                           "the JSON document's values");
    Json root = parseJson(container.json, document.name);
    static const JsonSchema version_schema(kGltfSchemaText, "versioned"), schema(kGltfSchemaText);
    const auto check = [&](const JsonSchema& s) {
        if (const auto problem = s.firstProblem(root)) {
            document.fail(ErrorCode::kInvalidScene, gltfPath(problem->path), problem->message);
        }
    };
    check(version_schema);
    checkVersion(document, root["asset"]);  // first: in another version all else would look wrong
    check(schema);

    checkExtensions(document, root);

    const Json buffers = takeArray(root, "buffers");
    for (const Json& image : takeArray(root, "images")) {
        document.images.push_back({image.value("uri", ""), image.value("bufferView", -1)});
    }
    for (const char* unused : {"animations", "extras"}) root.erase(unused);
    const std::vector<int> indices = takeIndices(root);
    const std::string stripped = root.dump();
    root = Json();
    if (stripped.size() > std::numeric_limits<unsigned>::max()) {
        document.fail(ErrorCode::kUnsupported, "root", "JSON of more than 4 GB");
    }
    tinygltf::TinyGLTF reader;
    std::string error, warning;
    if (!reader.LoadASCIIFromString(&document.model, &error, &warning, stripped.data(),
                                    unsigned(stripped.size()), "")) {
        throw Error(ErrorCode::kInvalidScene, document.name, oneLine(error));
    }
    putIndices(indices, document.model);
    loadBuffers(document, buffers, container);
    decodeMeshoptViews(document);
    return document;
}

std::string_view bufferBytes(const GltfDocument& document, int buffer, size_t offset, size_t length,
                             const std::string& path) {
    document.checkIndex(buffer, document.buffers.size(), path + ".buffer", "buffers");
    const std::string& bytes = document.buffers[buffer];
    if (offset > bytes.size() || length > bytes.size() - offset) {
        document.fail(ErrorCode::kInvalidScene, path,
                      "bytes " + std::to_string(offset) + " + " + std::to_string(length) +
                          " lie beyond the " + std::to_string(bytes.size()) + " bytes of buffers[" +
                          std::to_string(buffer) + "]");
    }
    return std::string_view(bytes).substr(offset, length);
}

std::string_view bufferViewBytes(const GltfDocument& document, int view, const std::string& path) {
    document.checkIndex(view, document.model.bufferViews.size(), path, "bufferViews");
    if (const auto it = document.decoded_views.find(view); it != document.decoded_views.end())
        return it->second;
    const tinygltf::BufferView& v = document.model.bufferViews[view];
    return bufferBytes(document, v.buffer, v.byteOffset, v.byteLength,
                       "bufferViews[" + std::to_string(view) + "]");
}

std::string imageBytes(const GltfDocument& document, int image) {
    const GltfImage& source = document.images[image];
    const std::string path = "images[" + std::to_string(image) + "]";
    if (!source.uri.empty()) return bytesOfUri(document, source.uri, path + ".uri");
    if (source.buffer_view < 0)
        document.fail(ErrorCode::kInvalidScene, path, "has neither uri nor bufferView");
    return std::string(bufferViewBytes(document, source.buffer_view, path + ".bufferView"));
}

}  // namespace stipple
