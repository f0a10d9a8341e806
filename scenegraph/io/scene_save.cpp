// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/scene_save.h>

#include <core/image.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/load_context.h>

#include <filesystem>
#include <unordered_map>

namespace stipple {

namespace {

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
    throw Error(ErrorCode::kInvalidArgument, oneLine(path, 300), why);
}

Json matrixOf(const Affine& a) {
    Json m = Json::array();
    for (int c = 0; c < 4; ++c) {
        const DVec3 column = c < 3 ? a.linear[c] : a.translation;
        for (int r = 0; r < 3; ++r) m.push_back(column[r]);
        m.push_back(c < 3 ? 0 : 1);
    }
    return m;
}

Json editsOf(const Group& group, const std::unordered_map<uint32_t, std::string>& names,
             const std::string& path) {
    Json edits = Json::object();
    if (!group.copy_of.empty()) edits["copy_of"] = group.copy_of;
    std::vector<uint32_t> slot_of(group.edited.size(), 0xffffffffu);
    for (uint32_t slot = 0; slot < group.instances.size(); ++slot) {
        if (!group.instances.child(slot).isNone() && group.listed_index[slot] < slot_of.size())
            slot_of[group.listed_index[slot]] = slot;
    }
    Json removed = Json::array(), placed = Json::array();
    for (uint32_t index = 0; index < group.edited.size(); ++index) {
        if (!group.edited[index]) continue;
        const uint32_t slot = slot_of[index];
        if (slot == 0xffffffffu) {
            if (index < group.ruled_count) removed.push_back(index);
            continue;
        }
        const auto name = names.find(group.instances.child(slot).bits);
        if (name == names.end())
            refuse(path, "instance " + std::to_string(index) + " of group " + inQuotes(group.name) +
                             " shows what has no name in the scene file");
        placed.push_back({{"index", index},
                          {"child", name->second},
                          {"matrix", matrixOf(group.instances.groupFromChild(slot))}});
    }
    if (!removed.empty()) edits["removed"] = std::move(removed);
    if (!placed.empty()) edits["placed"] = std::move(placed);
    if (group.next_index > group.ruled_count) edits["next"] = group.next_index;
    return edits;
}

}  // namespace

void saveScene(const Scene& scene, const std::map<std::string, std::string>& assets,
               const std::string& path) {
    if (!scene.path.ends_with(".scene.json"))
        refuse(scene.path, "only scene files (*.scene.json) can be saved; this is a model");
    if (!path.ends_with(".scene.json")) refuse(path, "a scene file's name ends in .scene.json");
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::path parent = fs::path(path).parent_path();
    const fs::path folder = fs::canonical(parent.empty() ? fs::path(".") : parent, error);
    if (error || folder != folderOf(scene.path)) {
        const fs::path name = fs::path(path).filename();
        refuse(path, "must be in the folder of " + oneLine(scene.path, 300) +
                         ", as paths in it are relative: " +
                         oneLine((fs::path(scene.path).parent_path() / name).string(), 300));
    }
    Diagnostics diagnostics;
    const LoadOptions options;
    LoadContext context(options, diagnostics, folderOf(scene.path));
    Json document = parseJson(readFile(scene.path, context.budget, scene.path), scene.path);
    std::unordered_map<uint32_t, std::string> names;
    for (const auto& [name, child] : scene.names) names.emplace(child.bits, name);
    Json edits = Json::object();
    for (uint32_t g = 0; g < scene.groups.size(); ++g) {
        const Group& group = scene.groups[g];
        if (group.edited.empty() && group.copy_of.empty()) continue;
        const auto name = names.find(ChildRef::group(g).bits);
        if (name == names.end())
            refuse(path,
                   "group " + inQuotes(group.name) +
                       " is part of a model, not of the scene file: its edits cannot be saved");
        edits[name->second] = editsOf(group, names, path);
    }
    for (const auto& [name, text] : assets) document["assets"][name] = parseJson(text, name);
    document.erase("edits");
    if (!edits.empty()) document["edits"] = std::move(edits);
    saveFile(path, document.dump(1, ' ') + "\n");
}

}  // namespace stipple
