// SPDX-License-Identifier: Apache-2.0
// The parts of reading a scene file: assets (scene_assets.cpp), groups (scene_groups.cpp), the rest
// (scene_file.cpp). Internal.
#pragma once

#include <core/parallel.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/load_context.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/scatter.h>

#include <map>

namespace stipple {

// A terrain asset's heights, kept while groups scatter over it.
struct Terrain {
    HeightField field;
    double size = 0.0;
};

struct SceneReader {
    LoadContext& context;
    std::string name;              // as errors call the file
    std::filesystem::path folder;  // of the file
    Scene scene;
    std::map<std::string, ChildRef> children;  // assets and groups by name
    std::map<std::string, Terrain> terrains;
    std::map<std::string, ChildRef> files;  // assets by path: each file is loaded once

    std::string where(const JsonPath& path) const { return name + ": " + jsonPointer(path); }
    [[noreturn]] void fail(const JsonPath& path, const std::string& message) const {
        throw Error(ErrorCode::kInvalidScene, where(path), message);
    }
    // The asset or group of that name. Throws naming the nearest one.
    ChildRef child(const std::string& child_name, const JsonPath& path) const;
};

// Adds the assets' meshes, materials and textures, and their names. What is generated is so in
// parallel.
void readAssets(SceneReader& reader, const Json& assets, ThreadPool& pool);

// Adds the instances of groups[index], whose name is in reader.children already. instances: the
// group's explicit ones, which have been taken out of `group` and are not yet validated.
void readGroup(SceneReader& reader, uint32_t index, const Json& group, const Json& instances);

// Calls make(), giving errors about its parameters (kInvalidArgument) a place in the file.
template <class Make>
auto withPlace(const SceneReader& reader, const JsonPath& path, const Make& make) {
    try {
        return make();
    } catch (const Error& e) {
        if (e.code() != ErrorCode::kInvalidArgument) throw;
        reader.fail(path, e.what());
    }
}

// Members of validated objects.
template <class T>
void readMember(const Json& object, const char* key, T& value) {
    if (const auto it = object.find(key); it != object.end()) value = it->get<T>();
}
template <class V>
void readVector(const Json& object, const char* key, V& value) {
    const auto it = object.find(key);
    if (it == object.end()) return;
    for (int i = 0; i < V::length(); ++i) value[i] = (*it)[i].get<typename V::value_type>();
}
inline void readDegrees(const Json& object, const char* key, double& value) {
    if (const auto it = object.find(key); it != object.end()) value = radians(it->get<double>());
}

}  // namespace stipple
