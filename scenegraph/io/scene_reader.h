// SPDX-License-Identifier: Apache-2.0
// The parts of reading a scene file: assets (scene_assets.cpp, scene_grids.cpp), groups
// (scene_groups.cpp), lights (scene_lights.cpp), the rest (scene_file.cpp). Internal.
#pragma once

#include <core/parallel.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/load_context.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/scatter.h>

#include <map>

namespace stipple {

struct SceneReader {
    LoadContext& context;
    ThreadPool& pool;
    std::string name;              // as errors call the file that is being read
    std::filesystem::path folder;  // of that file
    Scene scene;
    std::map<std::string, ChildRef> children;  // assets and groups by name
    std::map<std::string, uint32_t> groups;    // the groups of the file: indices into scene.groups
    std::map<std::string, HeightField>
        terrains;                           // of terrain assets, while groups scatter over them
    std::map<std::string, ChildRef> files;  // assets by path: each file is loaded once

    std::string where(const JsonPath& path) const { return name + ": " + jsonPointer(path); }
    [[noreturn]] void fail(const JsonPath& path, const std::string& message) const {
        throw Error(ErrorCode::kInvalidScene, where(path), message);
    }
    // The asset or group of that name. Throws naming the nearest one.
    ChildRef child(const std::string& child_name, const JsonPath& path) const;
    // The file that the string at `path` names. Throws as resolvePath().
    std::filesystem::path file(const Json& value, const JsonPath& path) const;
};

// Adds the assets' meshes, materials and textures, and their names. What is generated is so in
// parallel.
void readAssets(SceneReader& reader, const Json& assets);

// The asset that is a grid (scene_grids.cpp).
ChildRef readGrid(SceneReader& reader, const std::string& name, const Json& asset,
                  const JsonPath& path);

// Adds the instances of groups[index], whose name is in reader.children already. instances: the
// group's explicit ones, which have been taken out of `group` and are not yet validated.
void readGroup(SceneReader& reader, uint32_t index, const Json& group, const Json& instances);

// Changes what the rules of groups have made, and copies groups (scene_edits.cpp).
void readEdits(SceneReader& reader, const Json& edits);

// Fills the scene's lighting from the document's lights, background and exposure.
void readLighting(SceneReader& reader, const Json& root);

// `path` with further steps.
inline JsonPath joined(JsonPath path, std::initializer_list<std::string> rest) {
    path.insert(path.end(), rest);
    return path;
}

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
template <class T>
void readDegrees(const Json& object, const char* key, T& value) {
    if (const auto it = object.find(key); it != object.end()) value = T(radians(it->get<double>()));
}

// `value` with length 1. Throws for (almost) zero.
inline DVec3 unitVector(const SceneReader& reader, const DVec3& value, const JsonPath& path) {
    const double length = glm::length(value);
    if (!(length > 1e-9)) reader.fail(path, "the vector is zero");
    return value / length;
}
// The direction from `from` that the object at `path` gives by "target" or "direction": unit.
DVec3 readDirection(const SceneReader& reader, const Json& object, const DVec3& from,
                    const JsonPath& path);

}  // namespace stipple
