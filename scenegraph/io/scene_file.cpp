// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/scene_file.h>

#include <core/nearest_name.h>
#include <core/settings.h>
#include <scenegraph/io/scene_reader.h>
#include <scenegraph/io/schemas.h>

#include <set>

namespace stipple {

namespace {

// `value` with length 1. Throws for (almost) zero.
DVec3 unitVector(const SceneReader& reader, const DVec3& value, const JsonPath& path) {
    const double length = glm::length(value);
    if (!(length > 1e-9)) reader.fail(path, "the vector is zero");
    return value / length;
}

Camera readCamera(const SceneReader& reader, const Json& source, const JsonPath& path) {
    const auto at = [&](const char* key) {
        JsonPath p = path;
        p.push_back(key);
        return p;
    };
    DVec3 eye(0), up(0, 1, 0), target(0), direction(0);
    readVector(source, "eye", eye);
    readVector(source, "up", up);
    if (source.contains("target") == source.contains("direction"))
        reader.fail(path, "needs either target or direction");
    if (source.contains("target")) {
        readVector(source, "target", target);
        direction = unitVector(reader, target - eye, at("target"));
    } else {
        readVector(source, "direction", direction);
        direction = unitVector(reader, direction, at("direction"));
    }
    Camera camera = lookAt(eye, eye + direction, unitVector(reader, up, at("up")));
    camera.eye = eye;
    camera.name = source["name"].get<std::string>();
    if (source.contains("fov") && source.contains("orthographic"))
        reader.fail(path, "has both fov and orthographic");
    camera.orthographic = source.contains("orthographic");
    readMember(source, "orthographic", camera.height);
    readDegrees(source, "fov", camera.fov_y);
    readMember(source, "near", camera.near_z);
    readMember(source, "far", camera.far_z);
    if (!(camera.near_z < camera.far_z)) reader.fail(path, "near is not less than far");
    return camera;
}

void readCameras(SceneReader& reader, const Json& cameras) {
    std::set<std::string> names;
    for (size_t i = 0; i < cameras.size(); ++i) {
        const JsonPath path = {"cameras", std::to_string(i)};
        reader.scene.cameras.push_back(readCamera(reader, cameras[i], path));
        const std::string& name = reader.scene.cameras.back().name;
        if (!names.insert(name).second)
            reader.fail(path, "a camera before has the name " + inQuotes(name) + " too");
    }
}

void readLighting(SceneReader& reader, const Json& root) {
    Lighting& lighting = reader.scene.lighting;
    readMember(root, "exposure", lighting.exposure);
    if (const auto sky = root.find("background"); sky != root.end()) {
        readVector(*sky, "zenith", lighting.sky.zenith);
        readVector(*sky, "horizon", lighting.sky.horizon);
        readVector(*sky, "ground", lighting.sky.ground);
        readMember(*sky, "haze_distance", lighting.sky.haze_distance);
    }
    const auto lights = root.find("lights");
    if (lights == root.end()) {
        Sun sun;
        sun.direction_to_light = glm::normalize(sun.direction_to_light);
        lighting.suns.push_back(sun);
        return;
    }
    if (!lights->contains("suns")) return;
    const Json& suns = (*lights)["suns"];
    for (size_t i = 0; i < suns.size(); ++i) {
        Sun sun;
        DVec3 direction(0);
        readVector(suns[i], "direction", direction);
        sun.direction_to_light =
            Vec3(unitVector(reader, direction, {"lights", "suns", std::to_string(i), "direction"}));
        readVector(suns[i], "irradiance", sun.irradiance);
        lighting.suns.push_back(sun);
    }
}

void readRenderDefaults(SceneReader& reader, const Json& settings) {
    RenderSettings scratch;  // values are checked here, where they have a place
    for (const auto& [key, value] : settings.items()) {
        const std::string where = reader.where({"render", key});
        std::string text = value.is_string() ? value.get<std::string>() : value.dump();
        if (value.is_boolean()) text = value.get<bool>() ? "on" : "off";
        try {
            applySetting(scratch, key, text, where);
        } catch (const Error& e) {  // what is wrong is wrong with the scene here
            const std::string message = oneLine(e.what(), 400);
            throw Error(ErrorCode::kInvalidScene, "",
                        message.starts_with(where) ? message : where + ": " + message);
        }
        reader.scene.render_defaults[key] = text;
    }
}

// Takes the lists of explicit instances out of the document: there may be millions, too many for
// the schema validator, so that readGroup() checks them.
std::map<std::string, Json> takeInstances(Json& root) {
    std::map<std::string, Json> lists;
    if (!root.is_object() || !root.contains("groups") || !root["groups"].is_object()) return lists;
    for (auto& [name, group] : root["groups"].items()) {
        if (!group.is_object() || !group.contains("instances") || !group["instances"].is_array())
            continue;
        lists[name] = Json::array();
        lists[name].swap(group["instances"]);
    }
    return lists;
}

}  // namespace

ChildRef SceneReader::child(const std::string& child_name, const JsonPath& path) const {
    if (const auto it = children.find(child_name); it != children.end()) return it->second;
    std::vector<std::string> names;
    for (const auto& [known, unused] : children) names.push_back(known);
    const std::string nearest = nearestName(child_name, names);
    fail(path, "there is no asset or group " + inQuotes(child_name) +
                   (nearest.empty() ? "" : "; did you mean " + inQuotes(nearest) + "?"));
}

Scene readSceneFile(const std::filesystem::path& path, const std::string& name,
                    LoadContext& context, ThreadPool& pool) {
    SceneReader reader{context, oneLine(name, 300), context.folder, {}, {}, {}, {}};
    Json root;
    {
        const std::string text = readFile(path, context.budget, reader.name);
        context.budget.require(10.0 * double(text.size()), reader.name,
                               "the JSON document's values");
        root = parseJson(text, reader.name);
    }
    std::map<std::string, Json> instances = takeInstances(root);
    static const JsonSchema schema(kSceneSchemaText);
    if (const auto problem = schema.firstProblem(root))
        reader.fail(problem->path, problem->message);

    if (const auto assets = root.find("assets"); assets != root.end())
        readAssets(reader, *assets, pool);
    if (const auto groups = root.find("groups"); groups != root.end()) {
        const uint32_t first = uint32_t(reader.scene.groups.size());
        for (const auto& [group_name, unused] : groups->items()) {
            Group group;
            group.name = oneLine(group_name);
            const ChildRef ref = ChildRef::group(uint32_t(reader.scene.groups.size()));
            reader.scene.groups.push_back(std::move(group));
            if (!reader.children.emplace(group_name, ref).second) {
                reader.fail({"groups", group_name}, "an asset has this name too");
            }
        }
        uint32_t index = first;
        for (const auto& [group_name, group] : groups->items()) {
            context.throwIfCancelled();
            readGroup(reader, index++, group, instances[group_name]);
            instances.erase(group_name);
        }
    }
    const std::string& root_name = root["root"].get_ref<const std::string&>();
    const ChildRef root_child = reader.child(root_name, {"root"});
    if (!root_child.isGroup()) {
        Group group;
        group.name = oneLine(root_name);
        group.instances.add(root_child, Affine());
        reader.scene.groups.push_back(std::move(group));
    }
    reader.scene.root =
        root_child.isGroup() ? root_child.index() : uint32_t(reader.scene.groups.size() - 1);
    readLighting(reader, root);
    if (root.contains("cameras")) readCameras(reader, root["cameras"]);
    if (root.contains("render")) readRenderDefaults(reader, root["render"]);
    return std::move(reader.scene);
}

}  // namespace stipple
