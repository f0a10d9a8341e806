// SPDX-License-Identifier: Apache-2.0
// What the tests of the loaders share: a folder that vanishes, small glTF documents made in place,
// and loading them.
#pragma once

#include <scenegraph/io/json.h>
#include <scenegraph/io/load.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace stipple {

class TempFolder {
public:
    TempFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "stipple_io_XXXXXX").string();
        path_ = mkdtemp(name.data());
    }
    ~TempFolder() { std::filesystem::remove_all(path_); }
    TempFolder(const TempFolder&) = delete;
    TempFolder& operator=(const TempFolder&) = delete;

    std::string path(const std::string& name) const { return (path_ / name).string(); }
    std::string write(const std::string& name, const std::string& bytes) const {
        std::filesystem::create_directories((path_ / name).parent_path());
        std::ofstream(path_ / name, std::ios::binary) << bytes;
        return path(name);
    }

private:
    std::filesystem::path path_;
};

inline std::string base64(const std::string& bytes) {
    static const char* const kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t word = 0;
        for (size_t k = 0; k < 3; ++k)
            word = word << 8 | (i + k < bytes.size() ? uint8_t(bytes[i + k]) : 0);
        for (size_t k = 0; k < 4; ++k)
            text += i + k <= bytes.size() ? kDigits[word >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

// A glTF document with one buffer, to which arrays are appended.
struct GltfBuilder {
    Json json = {{"asset", {{"version", "2.0"}}}};
    std::string bin;

    // Appends the values as a buffer view and an accessor over it; returns the accessor's index.
    template <class T>
    int add(const std::vector<T>& values, const char* type, int component_type,
            bool normalized = false) {
        const int n_components = *type == 'S' ? 1 : type[3] - '0';
        const int view = addView(values);
        json["accessors"].push_back({{"bufferView", view},
                                     {"componentType", component_type},
                                     {"count", values.size() / n_components},
                                     {"type", type},
                                     {"normalized", normalized}});
        return int(json["accessors"].size()) - 1;
    }
    int addFloats(const std::vector<float>& values, const char* type) {
        return add(values, type, 5126);
    }
    template <class T>
    int addView(const std::vector<T>& values) {
        bin.resize((bin.size() + 3) / 4 * 4);
        json["bufferViews"].push_back(
            {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size() * sizeof(T)}});
        bin.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
        return int(json["bufferViews"].size()) - 1;
    }

    // One mesh of the triangle (0,0,0) (1,0,0) (0,1,0), shown by node 0 of scene 0.
    static GltfBuilder triangle() {
        GltfBuilder b;
        const int position = b.addFloats({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
        const int indices = b.add<uint16_t>({0, 1, 2}, "SCALAR", 5123);
        b.json["meshes"] = {
            {{"primitives", {{{"attributes", {{"POSITION", position}}}, {"indices", indices}}}}}};
        b.json["nodes"] = {{{"mesh", 0}}};
        b.json["scenes"] = {{{"nodes", {0}}}};
        b.json["scene"] = 0;
        return b;
    }
    Json& primitive() { return json["meshes"][0]["primitives"][0]; }

    // With the buffer as a data URI.
    std::string gltf() {
        Json result = json;
        if (!result.contains("buffers")) {
            result["buffers"] = {{{"byteLength", bin.size()},
                                  {"uri", "data:application/octet-stream;base64," + base64(bin)}}};
        }
        return result.dump();
    }
    std::string glb() {
        Json result = json;
        if (!result.contains("buffers")) result["buffers"] = {{{"byteLength", bin.size()}}};
        std::string text = result.dump(), data = bin;
        text.resize((text.size() + 3) / 4 * 4, ' ');
        data.resize((data.size() + 3) / 4 * 4, '\0');
        const auto word = [](size_t v) {
            const uint32_t w = uint32_t(v);
            return std::string(reinterpret_cast<const char*>(&w), 4);
        };
        return "glTF" + word(2) + word(12 + 8 + text.size() + 8 + data.size()) + word(text.size()) +
               "JSON" + text + word(data.size()) + std::string("BIN\0", 4) + data;
    }
};

// What became of a file: a scene, or an error.
struct Loaded {
    Scene scene;
    Diagnostics diagnostics;
    std::string error;  // what(), without the folder's name; empty: loaded
    ErrorCode code = ErrorCode::kInternal;
};

inline Loaded tryLoad(const std::string& path, LoadOptions options = {}) {
    Loaded result;
    ThreadPool pool(1);
    try {
        result.scene = loadScene(path, options, pool, result.diagnostics);
    } catch (const Error& e) {
        result.error = e.what();
        result.code = e.code();
        const std::string folder = std::filesystem::path(path).parent_path().string() + "/";
        if (result.error.starts_with(folder)) result.error.erase(0, folder.size());
    }
    return result;
}

inline Loaded tryLoadText(const std::string& name, const std::string& bytes,
                          LoadOptions options = {}) {
    const TempFolder folder;
    return tryLoad(folder.write(name, bytes), options);
}

// Calls visit(changed) for the document with every one of its values, in turn, replaced by values
// that are wrong in some way or odd.
template <class Visit>
void forEachOddity(const Json& document, const Visit& visit) {
    static const Json kOdd = Json::parse(
        R"([null, true, "all", "\n\u0000x", -1, 0, 2.5, 1e-30, 1e308, 4294967296, 18446744073709551615, [], {}, [0, 0, 0]])");
    const Json flat = document.flatten();
    std::vector<Json::json_pointer> places;
    for (const auto& [pointer, unused] : flat.items()) {
        for (Json::json_pointer p(pointer); !p.empty(); p = p.parent_pointer()) places.push_back(p);
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    for (const Json::json_pointer& place : places) {
        for (const Json& odd : kOdd) {
            Json changed = document;
            changed[place] = odd;
            visit(changed);
        }
    }
}

// The folder of real models, empty if there is none.
inline std::string testDataFolder() {
    if (const char* folder = std::getenv("STIPPLE_TEST_DATA")) return folder;
    const auto beside = std::filesystem::path(__FILE__).parent_path() / "../../../shared/data";
    std::error_code error;
    return std::filesystem::is_directory(beside, error) ? beside.lexically_normal().string() : "";
}

}  // namespace stipple
