// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/scene_file.h>

#include <core/settings.h>
#include <scenegraph/io/picture.h>
#include <scenegraph/io/scene_reader.h>
#include <scenegraph/io/schemas.h>

#include <set>

namespace stipple {

namespace {

Camera readCamera(const SceneReader& reader, const Json& source, const JsonPath& path) {
    DVec3 eye(0), up(0, 1, 0);
    readVector(source, "eye", eye);
    readVector(source, "up", up);
    const DVec3 direction = readDirection(reader, source, eye, path);
    Camera camera = lookAt(eye, eye + direction, unitVector(reader, up, joined(path, {"up"})));
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

void readProjectors(SceneReader& reader, const Json& projectors) {
    for (size_t i = 0; i < projectors.size(); ++i) {
        const Json& source = projectors[i];
        const JsonPath path = {"projectors", std::to_string(i)};
        const JsonPath picture_path = joined(path, {"picture"});
        const Camera camera = readCamera(reader, source, path);
        Projector& projector = reader.scene.lighting.projectors.emplace_back();
        projector.name = camera.name;
        Texture picture =
            readTexture(reader.file(source["picture"], picture_path), true, false, reader.context,
                        reader.where(picture_path) + ": " +
                            inQuotes(source["picture"].get_ref<const std::string&>()));
        picture.wrap_u = picture.wrap_v = Wrap::kClamp;
        projector.view = makeView(camera, picture.levels[0].width, picture.levels[0].height, 1);
        projector.picture = std::make_shared<const Texture>(std::move(picture));
        std::string mode = "replace";
        readMember(source, "mode", mode);
        projector.mode = mode == "replace" ? ProjectorMode::kReplace : ProjectorMode::kModulate;
    }
}

// Without times the eye keeps one pace: times are the lengths of the way, in metres.
void readKeyTimes(const SceneReader& reader, const Json& keys, const JsonPath& path,
                  std::vector<CameraKey>& result) {
    for (size_t i = 0; i < keys.size(); ++i) {
        const JsonPath place = joined(path, {std::to_string(i)});
        if (keys[i].contains("time") != keys[0].contains("time"))
            reader.fail(place, "has a time and others have not; give all or none");
        if (!keys[i].contains("time")) {
            if (i == 0) continue;
            const double way = glm::length(result[i].eye - result[i - 1].eye);
            if (!(way > 1e-9))
                reader.fail(place, "the eye is where it was before; give times to the keys");
            result[i].time = result[i - 1].time + way;
            continue;
        }
        result[i].time = keys[i]["time"].get<double>();
        if (i > 0 && !(result[i].time > result[i - 1].time))
            reader.fail(joined(place, {"time"}), "is not later than that of the key before");
    }
}

CameraPath readPath(const SceneReader& reader, const Json& source, const JsonPath& path) {
    CameraPath result;
    result.name = source["name"].get<std::string>();
    readVector(source, "up", result.up);
    result.up = unitVector(reader, result.up, joined(path, {"up"}));
    readMember(source, "near", result.near_z);
    readMember(source, "far", result.far_z);
    if (!(result.near_z < result.far_z)) reader.fail(path, "near is not less than far");
    const Json& keys = source["keys"];
    const JsonPath keys_path = joined(path, {"keys"});
    result.aims_are_directions = keys[0].contains("direction");
    for (size_t i = 0; i < keys.size(); ++i) {
        const JsonPath place = joined(keys_path, {std::to_string(i)});
        CameraKey key;
        readVector(keys[i], "eye", key.eye);
        const DVec3 direction = readDirection(reader, keys[i], key.eye, place);
        if (keys[i].contains("direction") != result.aims_are_directions)
            reader.fail(place, "some keys have target and some direction; give all the same");
        key.aim = direction;
        if (!result.aims_are_directions) readVector(keys[i], "target", key.aim);
        if (i > 0) key.fov_y = result.keys.back().fov_y;
        readDegrees(keys[i], "fov", key.fov_y);
        result.keys.push_back(key);
    }
    readKeyTimes(reader, keys, keys_path, result.keys);
    return result;
}

void readPaths(SceneReader& reader, const Json& paths) {
    for (size_t i = 0; i < paths.size(); ++i) {
        const JsonPath place = {"paths", std::to_string(i)};
        CameraPath path = readPath(reader, paths[i], place);
        if (reader.scene.findPath(path.name))
            reader.fail(place, "a path before has the name " + inQuotes(path.name) + " too");
        reader.scene.paths.push_back(std::move(path));
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

// One file: the scene's own or one that it includes.
struct SceneDocument {
    std::string name;              // as errors call the file
    std::filesystem::path folder;  // of the file
    Json root;
    std::map<std::string, Json> instances;  // of its groups
};

constexpr size_t kMostIncludeLevels = 16;

// The scene file and all that it includes, itself last; each file once.
class DocumentLoader {
public:
    explicit DocumentLoader(SceneReader& reader) : reader_(reader) {}

    std::vector<SceneDocument> load(const std::filesystem::path& path) {
        read(path, reader_.name);
        return std::move(documents_);
    }

private:
    void read(const std::filesystem::path& path, const std::string& name) {
        LoadContext& context = reader_.context;
        context.throwIfCancelled();
        SceneDocument document{name, path.parent_path(), {}, {}};
        reader_.name = document.name, reader_.folder = document.folder;
        {
            const std::string text = readFile(path, context.budget, name);
            context.budget.require(10.0 * double(text.size()), name, "the JSON document's values");
            document.root = parseJson(text, name);
        }
        document.instances = takeInstances(document.root);
        static const JsonSchema schema(kSceneSchemaText);
        if (const auto problem = schema.firstProblem(document.root))
            reader_.fail(problem->path, problem->message);
        if (!open_.empty() && document.root.contains("edits"))
            reader_.fail({"edits"}, "only the scene file itself has edits, not what it includes");
        if (const auto list = document.root.find("include"); list != document.root.end()) {
            open_.push_back(path);
            for (size_t i = 0; i < list->size(); ++i) {
                include(document, (*list)[i], {"include", std::to_string(i)});
                reader_.name = document.name, reader_.folder = document.folder;
            }
            open_.pop_back();
        }
        documents_.push_back(std::move(document));
    }

    void include(const SceneDocument& from, const Json& file, const JsonPath& place) {
        const std::filesystem::path path = reader_.file(file, place);
        if (std::find(open_.begin(), open_.end(), path) != open_.end())
            reader_.fail(place, inQuotes(file.get<std::string>()) + " includes itself");
        if (open_.size() > kMostIncludeLevels) {
            reader_.fail(place, "files that include each other more than " +
                                    std::to_string(kMostIncludeLevels) + " levels deep");
        }
        if (!seen_.insert(path).second) return;
        const std::string name =
            (std::filesystem::path(from.name).parent_path() / file.get_ref<const std::string&>())
                .lexically_normal()
                .string();
        read(path, oneLine(name, 300));
    }

    SceneReader& reader_;
    std::vector<SceneDocument> documents_;
    std::vector<std::filesystem::path> open_;
    std::set<std::filesystem::path> seen_;
};

// Calls visit(document, name, value) for all members of the documents' objects `key`.
template <class Visit>
void forEachMember(SceneReader& reader, std::vector<SceneDocument>& documents, const char* key,
                   const Visit& visit) {
    for (SceneDocument& document : documents) {
        reader.name = document.name, reader.folder = document.folder;
        const auto members = document.root.find(key);
        if (members == document.root.end()) continue;
        for (const auto& [name, value] : members->items()) {
            reader.context.throwIfCancelled();
            visit(document, name, value);
        }
    }
}

void readAssetsAndGroups(SceneReader& reader, std::vector<SceneDocument>& documents) {
    for (SceneDocument& document : documents) {
        reader.name = document.name, reader.folder = document.folder;
        const auto assets = document.root.find("assets");
        if (assets == document.root.end()) continue;
        for (const auto& [name, asset] : assets->items()) {
            if (reader.children.contains(name))
                reader.fail({"assets", name}, "an included file has an asset of this name");
        }
        readAssets(reader, *assets);
    }
    forEachMember(
        reader, documents, "groups", [&](SceneDocument&, const std::string& name, const Json&) {
            const uint32_t index = uint32_t(reader.scene.groups.size());
            if (reader.groups.contains(name))
                reader.fail({"groups", name}, "an included file has a group of this name");
            if (!reader.children.emplace(name, ChildRef::group(index)).second)
                reader.fail({"groups", name}, "an asset has this name too");
            reader.groups[name] = index;
            reader.scene.groups.emplace_back().name = oneLine(name);
        });
    forEachMember(reader, documents, "groups",
                  [&](SceneDocument& document, const std::string& name, const Json& group) {
                      readGroup(reader, reader.groups[name], group, document.instances[name]);
                      document.instances.erase(name);
                  });
}

}  // namespace

ChildRef SceneReader::child(const std::string& child_name, const JsonPath& path) const {
    if (const auto it = children.find(child_name); it != children.end()) return it->second;
    std::vector<std::string> names;
    for (const auto& [known, unused] : children) names.push_back(known);
    fail(path, "there is no asset or group " + inQuotes(child_name) + nameHint(child_name, names));
}

std::filesystem::path SceneReader::file(const Json& value, const JsonPath& path) const {
    return resolvePath(context, folder, value.get_ref<const std::string&>(), where(path));
}

DVec3 readDirection(const SceneReader& reader, const Json& object, const DVec3& from,
                    const JsonPath& path) {
    if (object.contains("target") == object.contains("direction"))
        reader.fail(path, object.contains("target")
                              ? "has both target and direction, which contradict each other"
                              : "needs target or direction");
    const bool has_target = object.contains("target");
    DVec3 v(0);
    readVector(object, has_target ? "target" : "direction", v);
    return unitVector(reader, has_target ? v - from : v,
                      joined(path, {has_target ? "target" : "direction"}));
}

Scene readSceneFile(const std::filesystem::path& path, const std::string& name,
                    LoadContext& context, ThreadPool& pool) {
    SceneReader reader{context, pool, oneLine(name, 300), context.folder, {}, {}, {}, {}, {}};
    std::error_code error;
    const std::filesystem::path canonical = std::filesystem::canonical(path, error);
    std::vector<SceneDocument> documents = DocumentLoader(reader).load(error ? path : canonical);
    readAssetsAndGroups(reader, documents);

    const SceneDocument& main = documents.back();
    reader.name = main.name, reader.folder = main.folder;
    const Json& root = main.root;
    if (root.contains("edits")) readEdits(reader, root["edits"]);
    reader.scene.names = reader.children;
    if (!root.contains("root")) reader.fail({}, "Missing required property 'root'");
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
    if (root.contains("projectors")) readProjectors(reader, root["projectors"]);
    if (root.contains("cameras")) readCameras(reader, root["cameras"]);
    if (root.contains("paths")) readPaths(reader, root["paths"]);
    if (root.contains("render")) readRenderDefaults(reader, root["render"]);
    return std::move(reader.scene);
}

}  // namespace stipple
