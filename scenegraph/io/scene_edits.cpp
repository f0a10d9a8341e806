// SPDX-License-Identifier: Apache-2.0
// "edits" of a scene file: what was changed of that which its groups' rules make.
#include <scenegraph/io/instance_json.h>
#include <scenegraph/io/scene_reader.h>

#include <limits>
#include <numeric>

namespace stipple {

namespace {

constexpr double kBytesPerEdit = 80.0;
constexpr uint64_t kMostIndices = std::numeric_limits<uint32_t>::max() - 1;

// A group as its rules make it, for one place.
void copyGroup(SceneReader& reader, const std::string& name, const std::string& source) {
    const JsonPath path = {"edits", name, "copy_of"};
    const auto found = reader.groups.find(source);
    if (found == reader.groups.end()) {
        reader.child(source, path);  // throws for an unknown name
        reader.fail(path, inQuotes(source) + " is no group of the scene file");
    }
    const uint32_t index = uint32_t(reader.scene.groups.size());
    if (!reader.children.emplace(name, ChildRef::group(index)).second)
        reader.fail({"edits", name}, "an asset or group has this name; it cannot be a copy");
    const Group& group = reader.scene.groups[found->second];
    reader.context.budget.take(double(group.instances.bytes()), reader.where(path),
                               std::to_string(group.instances.size()) + " instances");
    Group copy = group;
    copy.name = oneLine(name);
    copy.copy_of = source;
    reader.scene.groups.push_back(std::move(copy));
}

uint32_t readIndex(const SceneReader& reader, const Json& value, const JsonPath& path) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() > kMostIndices)
        reader.fail(path, "is no index of an instance");
    return uint32_t(value.get<uint64_t>());
}

void editGroup(SceneReader& reader, Group& group, const Json& edits, const JsonPath& path) {
    const Json none = Json::array();
    const Json& removed = edits.contains("removed") ? edits["removed"] : none;
    const Json& placed = edits.contains("placed") ? edits["placed"] : none;
    reader.context.budget.take(kBytesPerEdit * double(removed.size() + placed.size()) +
                                   sizeof(uint32_t) * double(group.instances.size()),
                               reader.where(path), "its edits");
    std::vector<uint32_t>& listed = group.listed_index;
    listed.resize(group.instances.size());
    std::iota(listed.begin(), listed.end(), 0u);
    group.next_index = uint32_t(listed.size());
    const uint32_t ruled = group.ruled_count;
    std::vector<uint32_t> edited;
    std::vector<bool> is_edited(ruled, false);
    const auto edit = [&](uint32_t index, const JsonPath& place) {
        if (index < ruled && is_edited[index]) reader.fail(place, "has been edited before");
        if (index < ruled) is_edited[index] = true;
        edited.push_back(index);
        group.next_index = std::max(group.next_index, index + 1);
    };
    for (size_t i = 0; i < removed.size(); ++i) {
        const JsonPath place = joined(path, {"removed", std::to_string(i)});
        const uint32_t index = readIndex(reader, removed[i], place);
        if (index >= ruled)
            reader.fail(place, "the group's rules make no instance " + std::to_string(index));
        edit(index, place);
        group.instances.erase(index);
    }
    uint64_t last_added = 0;
    for (size_t i = 0; i < placed.size(); ++i) {
        const JsonPath place = joined(path, {"placed", std::to_string(i)});
        Json source = placed[i];
        const uint32_t index = readIndex(reader, source["index"], joined(place, {"index"}));
        source.erase("index");
        JsonInstance instance;
        if (!readInstance(source, instance)) reader.fail(place, "is not an instance");
        const ChildRef child = reader.child(*instance.child, joined(place, {"child"}));
        Affine transform;
        if (const char* problem = makeTransform(instance, transform)) reader.fail(place, problem);
        edit(index, place);
        if (index < ruled) {
            group.instances.set(index, child, transform);
            continue;
        }
        if (index <= last_added) reader.fail(place, "indices of what was added must grow");
        last_added = index;
        group.instances.add(child, transform);
        listed.push_back(index);
    }
    if (const auto next = edits.find("next"); next != edits.end())
        group.next_index =
            std::max(group.next_index, readIndex(reader, *next, joined(path, {"next"})));
    // Whether it is edited; and, where it is edited further, where it is and was.
    constexpr double kBytesAnIndex = 1.0 / 8.0 + 2.0 * sizeof(uint32_t);
    reader.context.budget.take(double(group.next_index) * kBytesAnIndex, reader.where(path),
                               "its edits");
    group.edited.assign(group.next_index, false);
    for (const uint32_t index : edited) group.edited[index] = true;
}

}  // namespace

void readEdits(SceneReader& reader, const Json& edits) {
    for (const auto& [name, group] : edits.items()) {
        if (group.contains("copy_of")) copyGroup(reader, name, group["copy_of"].get<std::string>());
    }
    for (const auto& [name, group] : edits.items()) {
        const ChildRef child = reader.child(name, {"edits", name});
        if (!child.isGroup() || (!reader.groups.contains(name) && !group.contains("copy_of")))
            reader.fail({"edits", name}, "is no group of the scene file");
        editGroup(reader, reader.scene.groups[child.index()], group, {"edits", name});
    }
}

}  // namespace stipple
