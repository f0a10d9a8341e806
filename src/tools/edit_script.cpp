// SPDX-License-Identifier: Apache-2.0
#include <tools/edit_script.h>

#include <scenegraph/io/instance_json.h>

#include <charconv>
#include <cstring>

namespace stipple {

namespace {

[[noreturn]] void fail(const std::string& place, const std::string& reason) {
    throw Error(ErrorCode::kInvalidScene, place, reason);
}

constexpr const char* kTransformKeys[] = {"translation", "rotation", "quaternion", "scale",
                                          "matrix"};

ChildRef namedChild(const std::string& name, const char* key, const Scene& scene) {
    const auto found = scene.names.find(name);
    if (found != scene.names.end()) return found->second;
    std::vector<std::string> names;
    for (const auto& [known, child] : scene.names) names.push_back(known);
    const std::string hint =
        names.empty() ? "; nothing of a model alone has a name: an \"asset\" line gives one"
                      : nameHint(name, names);
    fail(std::string("/") + key, "there is no asset or group " + inQuotes(name) + hint);
}

// The transform that the command's keys give.
Affine transformOf(const Json& command) {
    Json source = {{"child", ""}};
    for (const char* key : kTransformKeys) {
        if (command.contains(key)) source[key] = command[key];
    }
    JsonInstance instance;
    if (!readInstance(source, instance)) {
        static const std::map<std::string, const char*> kExpected = {
            {"translation", "three numbers (m) up to 1e9"},
            {"rotation", "three numbers (degrees) up to 1e6"},
            {"quaternion", "four numbers x, y, z, w up to 1e6"},
            {"scale", "a number up to 1e6, or three"},
            {"matrix", "16 numbers up to 1e9, column by column"}};
        for (const char* key : kTransformKeys) {
            if (!source.contains(key)) continue;
            const Json alone = {{"child", ""}, {key, source[key]}};
            if (!readInstance(alone, instance))
                fail(std::string("/") + key, std::string("is not ") + kExpected.at(key));
        }
    }
    Affine transform;
    if (const char* problem = makeTransform(instance, transform)) fail("", problem);
    return transform;
}

bool hasTransform(const Json& command) {
    for (const char* key : kTransformKeys) {
        if (command.contains(key)) return true;
    }
    return false;
}

uint32_t groupOf(const Json& command, const Scene& scene) {
    const std::string name = stringOf(command, "group", "");
    if (name.empty()) return scene.root;
    const ChildRef child = namedChild(name, "group", scene);
    if (!child.isGroup()) fail("/group", inQuotes(name) + " is an asset, not a group");
    return child.index();
}

std::vector<uint32_t> pathOf(const std::string& text) {
    std::vector<uint32_t> path;
    const char *at = text.data(), *end = at + text.size();
    for (;;) {
        uint32_t index = 0;
        const auto [next, error] = std::from_chars(at, end, index);
        if (error != std::errc() || (next != end && *next != '/')) {
            fail("/object",
                 inQuotes(text) + " is neither a label nor indices from the root down, as 12/5");
        }
        path.push_back(index);
        if (next == end) return path;
        at = next + 1;
    }
}

// What an insert calls its instance; "" without "as".
std::string newLabel(const Json& command, SceneEditor& editor, const EditMemory& memory) {
    const std::string label = stringOf(command, "as", "");
    if (!label.empty() && label[0] >= '0' && label[0] <= '9')
        fail("/as", inQuotes(label) + " begins with a digit, as indices do");
    const auto it = memory.labels.find(label);
    if (it != memory.labels.end() && editor.contains(it->second))
        fail("/as", "there is " + inQuotes(label) + " already");
    return label;
}

// Whether the path that names the object is to get copies of its own ("only_here").
bool isOnlyHere(const Json& command, const EditMemory& memory) {
    const Json only_here = command.value("only_here", Json(false));
    if (!only_here.is_boolean()) fail("/only_here", "is neither true nor false");
    return only_here.get<bool>() && !command.contains("index") &&
           !memory.labels.contains(stringOf(command, "object"));
}

// An instance: a label, a path from the root, or a group and an index.
InstanceId objectOf(const Json& command, SceneEditor& editor, const EditMemory& memory) {
    if (command.contains("index")) {
        if (!command["index"].is_number_unsigned() ||
            command["index"].get<uint64_t>() > 0xfffffffeu)
            fail("/index", "is no index of an instance");
        return {groupOf(command, editor.scene()), command["index"].get<uint32_t>()};
    }
    const std::string object = stringOf(command, "object");
    if (const auto label = memory.labels.find(object); label != memory.labels.end())
        return label->second;
    return editor.find(pathOf(object));
}

// The same, to be changed: once nothing can fail any more, as groups may be copied.
InstanceId ownObject(const Json& command, SceneEditor& editor, const EditMemory& memory) {
    return isOnlyHere(command, memory) ? editor.findOwn(pathOf(stringOf(command, "object")))
                                       : objectOf(command, editor, memory);
}

using Key = std::pair<uint32_t, uint32_t>;

}  // namespace

std::string stringOf(const Json& command, const char* key, const std::optional<std::string>& none) {
    const auto it = command.find(key);
    if (it == command.end()) {
        if (none) return *none;
        fail("", "needs " + inQuotes(key));
    }
    if (!it->is_string()) fail(std::string("/") + key, "is no string");
    return it->get<std::string>();
}

void checkKeys(const Json& command, std::initializer_list<const char*> known) {
    std::vector<std::string> names(known.begin(), known.end());
    names.push_back("do");
    for (const auto& [key, value] : command.items()) {
        if (std::find(names.begin(), names.end(), key) != names.end()) continue;
        fail("/" + oneLine(key), "has no meaning here" + nameHint(key, names));
    }
}

bool runEdit(const Json& command, SceneEditor& editor, EditMemory& memory, InstanceId& edited) {
    const std::string what = stringOf(command, "do");
    const Scene& scene = editor.scene();
    if (what == "insert") {
        checkKeys(command, {"child", "group", "as", "translation", "rotation", "quaternion",
                            "scale", "matrix"});
        const std::string label = newLabel(command, editor, memory);
        const ChildRef child = namedChild(stringOf(command, "child"), "child", scene);
        edited = editor.insert(groupOf(command, scene), child, transformOf(command));
        if (!label.empty()) memory.labels[label] = edited;
        return true;
    }
    if (what == "remove") {
        checkKeys(command, {"object", "group", "index", "only_here"});
        edited = ownObject(command, editor, memory);
        const std::pair<ChildRef, Affine> was = {editor.child(edited),
                                                 editor.groupFromChild(edited)};
        editor.remove(edited);
        memory.removed[Key{edited.group, edited.index}] = was;
        return true;
    }
    if (what == "move") {
        checkKeys(command, {"object", "group", "index", "only_here", "translation", "rotation",
                            "quaternion", "scale", "matrix"});
        if (!hasTransform(command)) fail("", "needs translation, rotation, scale or matrix");
        Affine transform = transformOf(command);
        const InstanceId moved = objectOf(command, editor, memory);
        // A place alone keeps the rest.
        const bool is_place_alone = command.contains("translation") &&
                                    !command.contains("rotation") &&
                                    !command.contains("quaternion") && !command.contains("scale");
        if (is_place_alone) transform.linear = editor.groupFromChild(moved).linear;
        editor.check(moved, editor.child(moved), transform);
        edited = ownObject(command, editor, memory);
        editor.move(edited, transform);
        return true;
    }
    if (what == "replace") {
        checkKeys(command, {"object", "group", "index", "only_here", "child"});
        const ChildRef child = namedChild(stringOf(command, "child"), "child", scene);
        const InstanceId replaced = objectOf(command, editor, memory);
        editor.check(replaced, child, editor.groupFromChild(replaced));
        edited = ownObject(command, editor, memory);
        editor.replace(edited, child);
        return true;
    }
    if (what == "restore") {
        checkKeys(command, {"object", "group", "index"});
        if (command.contains("index") || memory.labels.contains(stringOf(command, "object", ""))) {
            edited = objectOf(command, editor, memory);
        } else {  // the last step of the path is not there
            std::vector<uint32_t> path = pathOf(stringOf(command, "object"));
            edited = {scene.root, path.back()};
            path.pop_back();
            if (!path.empty()) {
                const ChildRef holder = editor.child(editor.find(path));
                if (!holder.isGroup()) fail("/object", "lies in no group");
                edited.group = holder.index();
            }
        }
        const auto was = memory.removed.find(Key{edited.group, edited.index});
        if (was == memory.removed.end()) fail("", "this script has not removed it");
        editor.restore(edited, was->second.first, was->second.second);
        memory.removed.erase(was);
        return true;
    }
    return false;
}

std::pair<std::string, Json> assetOf(const Json& command, const Scene& scene) {
    const std::string name = stringOf(command, "name");
    if (name.empty()) fail("/name", "is empty");
    if (scene.names.contains(name))
        fail("/name", "there is an asset or group " + inQuotes(name) + " already");
    Json asset = command;
    asset.erase("do");
    asset.erase("name");
    return {name, asset};
}

Camera cameraOf(const Json& command, const Scene& scene) {
    checkKeys(command, {"name", "eye", "target", "direction", "up", "fov"});
    if (command.contains("name")) {
        const std::string name = stringOf(command, "name");
        if (const Camera* camera = scene.findCamera(name)) return *camera;
        std::vector<std::string> names;
        for (const Camera& camera : scene.cameras) names.push_back(camera.name);
        fail("/name", "there is no camera " + inQuotes(name) + nameHint(name, names));
    }
    const auto vectorOf = [&](const char* key, DVec3 value) {
        if (command.contains(key) && !readNumbers(command[key], 3, kMaxInstanceLength, &value.x))
            fail(std::string("/") + key, "is not three numbers");
        return value;
    };
    if (!command.contains("eye")) fail("", "needs \"name\", or \"eye\" and \"target\"");
    if (command.contains("target") == command.contains("direction"))
        fail("", "needs either \"target\" or \"direction\"");
    const DVec3 eye = vectorOf("eye", DVec3(0));
    const DVec3 target = command.contains("target") ? vectorOf("target", DVec3(0))
                                                    : eye + vectorOf("direction", DVec3(0));
    const DVec3 up = vectorOf("up", DVec3(0, 1, 0));
    if (!(glm::length(glm::cross(target - eye, up)) > 1e-9))
        fail("", "the camera looks nowhere, or straight along \"up\"");
    Camera camera = lookAt(eye, target, up);
    if (command.contains("fov")) {
        double fov = 0.0;
        if (command["fov"].is_number()) fov = command["fov"].get<double>();
        if (!(fov > 0.01 && fov < 179.0)) fail("/fov", "is not between 0.01 and 179 degrees");
        camera.fov_y = radians(fov);
    }
    return camera;
}

}  // namespace stipple
