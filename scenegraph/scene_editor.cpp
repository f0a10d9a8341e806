// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/scene_editor.h>

#include <scenegraph/group_build.h>
#include <scenegraph/group_sums.h>

#include <bit>
#include <numeric>

namespace stipple {

namespace {

constexpr uint32_t kGone = 0xffffffffu;
constexpr uint32_t kMostResidents = 32;  // of a leaf, before it is split
constexpr uint32_t kFewInstances = 12;   // below a node that was built: merged
constexpr size_t kMostChanges = 1 << 16;

uint32_t placesOf(const GroupNode& node) { return node.resident_count + node.free_count; }

uint32_t capacityFor(uint32_t count) { return std::bit_ceil(std::max(count, 4u)); }

// For a copy: "tile~2".
std::string freeName(const Scene& scene, const std::string& name) {
    for (int i = 2;; ++i) {
        std::string result = name + "~" + std::to_string(i);
        if (!scene.names.contains(result)) return result;
    }
}

[[noreturn]] void refuse(const std::string& what) {
    throw Error(ErrorCode::kInvalidArgument, "", what);
}

}  // namespace

SceneEditor::SceneEditor(Scene& scene) : scene_(scene) {
    open_.resize(scene.groups.size());
    uses_.resize(scene.groups.size());
    holders_.resize(scene.groups.size());
    for (uint32_t g = 0; g < scene.groups.size(); ++g) {
        const Group& group = scene.groups[g];
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef child = group.instances.child(i);
            if (!child.isNone()) addUse({g, group.listed_index[i]}, child);
        }
    }
}

void SceneEditor::addUse(InstanceId place, ChildRef child) {
    if (!child.isGroup()) return;
    Uses& uses = uses_[child.index()];
    if (++uses.count <= kFewUses) uses.places.push_back(place);
    ++holders_[child.index()][place.group];
}

void SceneEditor::removeUse(InstanceId place, ChildRef child) {
    if (!child.isGroup()) return;
    Uses& uses = uses_[child.index()];
    --uses.count;
    std::erase(uses.places, place);
    std::map<uint32_t, size_t>& holders = holders_[child.index()];
    const auto found = holders.find(place.group);
    if (--found->second == 0) holders.erase(found);
}

SceneEditor::OpenGroup& SceneEditor::opened(uint32_t index) {
    if (index >= open_.size())
        refuse("there is no group " + std::to_string(index) + " in this scene");
    if (open_[index]) return *open_[index];
    const Group& group = scene_.groups[index];
    auto open = std::make_unique<OpenGroup>();
    const size_t n = group.instances.size();
    open->parent.assign(group.nodes.size(), 0);
    open->node_of.assign(n, 0);
    open->slot_of.assign(group.next_index, kGone);
    open->rank_of.resize(group.next_index);
    std::iota(open->rank_of.begin(), open->rank_of.end(), 0);
    for (uint32_t i = 0; i < n; ++i) {
        open->slot_of[group.listed_index[i]] = i;
        open->rank_of[group.listed_index[i]] = i;
    }
    std::vector<int> depth(group.nodes.size(), 0);
    for (uint32_t i = 0; i < group.nodes.size(); ++i) {
        const GroupNode& node = group.nodes[i];
        open->merge_at.push_back(std::min(kFewInstances, node.count / 2));
        open->built_height = std::max(open->built_height, depth[i]);
        for (uint32_t c = 0; c < node.child_count; ++c) {  // children come after their parents
            open->parent[node.first_child + c] = i;
            depth[node.first_child + c] = depth[i] + 1;
        }
        for (uint32_t r = 0; r < node.resident_count; ++r) open->node_of[node.first + r] = i;
    }
    open->free_places.resize(33);
    open->free_nodes.resize(9);
    open_[index] = std::move(open);
    return *open_[index];
}

void SceneEditor::open(uint32_t group) { opened(group); }

bool SceneEditor::contains(InstanceId id) {
    if (id.group >= scene_.groups.size()) return false;
    const OpenGroup& open = opened(id.group);
    return id.index < open.slot_of.size() && open.slot_of[id.index] != kGone;
}

uint32_t SceneEditor::slotOf(InstanceId id) {
    if (!contains(id)) {
        refuse("there is no instance " + std::to_string(id.index) + " in group \"" +
               (id.group < scene_.groups.size() ? scene_.groups[id.group].name : "?") + "\"");
    }
    return open_[id.group]->slot_of[id.index];
}

ChildRef SceneEditor::child(InstanceId id) {
    const uint32_t slot = slotOf(id);
    return scene_.groups[id.group].instances.child(slot);
}

Affine SceneEditor::groupFromChild(InstanceId id) {
    const uint32_t slot = slotOf(id);
    return scene_.groups[id.group].instances.groupFromChild(slot);
}

// The groups, each once, and all that hold them.
std::vector<uint32_t> SceneEditor::withHolders(std::vector<uint32_t> groups) const {
    std::vector<bool> seen(scene_.groups.size(), false);
    std::vector<uint32_t> result;
    while (!groups.empty()) {
        const uint32_t g = groups.back();
        groups.pop_back();
        if (seen[g]) continue;
        seen[g] = true;
        result.push_back(g);
        for (const auto& [holder, count] : holders_[g]) groups.push_back(holder);
    }
    return result;
}

bool SceneEditor::reaches(ChildRef from, uint32_t group) const {
    const std::vector<uint32_t> around = withHolders({group});
    return std::find(around.begin(), around.end(), from.index()) != around.end();
}

void SceneEditor::checkInsert(uint32_t group, ChildRef child, const Affine& transform) const {
    if (group >= scene_.groups.size())
        refuse("there is no group " + std::to_string(group) + " in this scene");
    if (child.isNone() ||
        child.index() >= (child.isGroup() ? scene_.groups.size() : scene_.meshes.size()))
        refuse("there is nothing of this kind to insert");
    if (!isFinite(transform)) refuse("the transform is not finite");
    const double length = maxLengthScale(transform.linear);
    if (!(std::abs(glm::determinant(transform.linear)) > 1e-12 * length * length * length))
        refuse("the transform is singular: it flattens what it places");
    if (child.isGroup()) {
        if (reaches(child, group))
            refuse("group \"" + scene_.groups[child.index()].name + "\" contains \"" +
                   scene_.groups[group].name + "\" already");
        if (scene_.groups[child.index()].depth + scene_.groups[scene_.root].depth > kDeepestNesting)
            refuse("groups would be nested more than " + std::to_string(kDeepestNesting) + " deep");
    }
}

InstanceId SceneEditor::insert(uint32_t group, ChildRef child, const Affine& group_from_child) {
    checkInsert(group, child, group_from_child);
    OpenGroup& open = opened(group);
    const InstanceId id{group, scene_.groups[group].next_index};
    if (id.index == kGone) refuse("more than 2^32 instances have been in this group");
    ++scene_.groups[group].next_index;
    open.slot_of.push_back(kGone);
    place(id, child, group_from_child);
    return id;
}

void SceneEditor::restore(InstanceId id, ChildRef child, const Affine& group_from_child) {
    checkInsert(id.group, child, group_from_child);
    if (id.index >= opened(id.group).slot_of.size() || contains(id))
        refuse("instance " + std::to_string(id.index) + " was not removed");
    place(id, child, group_from_child);
}

void SceneEditor::remove(InstanceId id) {
    slotOf(id);
    take(id);
}

void SceneEditor::move(InstanceId id, const Affine& group_from_child) {
    const ChildRef what = child(id);
    checkInsert(id.group, ChildRef::mesh(0), group_from_child);
    take(id);
    place(id, what, group_from_child);
}

void SceneEditor::replace(InstanceId id, ChildRef child) {
    const Affine where = groupFromChild(id);
    checkInsert(id.group, child, where);
    take(id);
    place(id, child, where);
}

InstanceId SceneEditor::insertMany(uint32_t group_index, const std::vector<NewInstance>& instances,
                                   ThreadPool& pool) {
    for (const NewInstance& i : instances) checkInsert(group_index, i.child, i.group_from_child);
    opened(group_index);
    Group& group = scene_.groups[group_index];
    const InstanceId first{group_index, group.next_index};
    if (uint64_t(first.index) + instances.size() >= kGone)
        refuse("more than 2^32 instances have been in this group");
    // Building costs about as much an instance as a tenth of an insert.
    if (instances.size() * 10 < group.nodes[0].count) {
        for (const NewInstance& i : instances) insert(group_index, i.child, i.group_from_child);
        return first;
    }
    const double instances_before = group.instances_total, triangles_before = group.triangles_total;
    for (const NewInstance& i : instances) {
        const InstanceId id{group_index, group.next_index};
        addUse(id, i.child);
        group.instances.add(i.child, i.group_from_child);
        group.listed_index.push_back(group.next_index++);
        markEdited(id);
    }
    const ChildSums as_child = group.as_child;
    buildGroup(scene_, group, scene_.path + ": /groups/" + group.name, pool);
    group.as_child = as_child;
    open_[group_index].reset();
    opened(group_index);
    rebuilt_.push_back(group_index);
    changes_.any = true;
    const double more_instances = group.instances_total - instances_before,
                 more_triangles = group.triangles_total - triangles_before;
    group.instances_total = instances_before, group.triangles_total = triangles_before;
    countInstances(group_index, more_instances, more_triangles);
    groupChanged(group_index);
    return first;
}

ChildRef SceneEditor::addAsset(const std::string& name, Scene asset, ChildRef child,
                               const std::string& description) {
    if (scene_.names.contains(name)) refuse("there is an asset or group \"" + name + "\" already");
    if (scene_.materials.size() + asset.materials.size() > 65536)
        refuse("the scene would have more than 65536 materials");
    const uint32_t first_mesh = uint32_t(scene_.meshes.size()),
                   first_group = uint32_t(scene_.groups.size()),
                   first_material = uint32_t(scene_.materials.size());
    const int first_texture = int(scene_.textures.size());
    const auto renamed = [&](ChildRef old) {
        if (old.isNone()) return old;
        return old.isGroup() ? ChildRef::group(first_group + old.index())
                             : ChildRef::mesh(first_mesh + old.index());
    };
    for (Texture& texture : asset.textures) scene_.textures.push_back(std::move(texture));
    for (Material& material : asset.materials) {
        for (int* texture : textureIndices(material)) {
            if (*texture != kNoTexture) *texture += first_texture;
        }
        scene_.materials.push_back(std::move(material));
    }
    for (Mesh& mesh : asset.meshes) {
        for (uint16_t& material : mesh.triangle_material)
            material = uint16_t(material + first_material);
        mesh.first_finish += first_material;
        for (MeshPatch& patch : mesh.patches) {
            for (MeshPatch::Triangles& triangles : patch.triangles)
                if (triangles.mesh != MeshPatch::kNoMesh) triangles.mesh += first_mesh;
            if (patch.surfels != MeshPatch::kNoMesh) patch.surfels += first_mesh;
        }
        scene_.meshes.push_back(std::move(mesh));
    }
    const size_t n_groups = first_group + asset.groups.size();
    open_.resize(n_groups);
    uses_.resize(n_groups);
    holders_.resize(n_groups);
    for (Group& group : asset.groups) {
        const uint32_t index = uint32_t(scene_.groups.size());
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef inner = renamed(group.instances.child(i));
            group.instances.setChild(i, inner);
            if (!inner.isNone()) addUse({index, group.listed_index[i]}, inner);
        }
        scene_.groups.push_back(std::move(group));
    }
    const ChildRef result = renamed(child);
    scene_.names[name] = result;
    added_assets_[name] = description;
    changes_.assets = changes_.any = true;
    return result;
}

InstanceId SceneEditor::find(const std::vector<uint32_t>& path) {
    if (path.empty()) refuse("an empty path names no instance");
    InstanceId id{scene_.root, path[0]};
    for (size_t i = 0;; ++i) {
        id.index = path[i];
        const ChildRef below = child(id);  // throws
        if (i + 1 == path.size()) return id;
        if (!below.isGroup())
            refuse("instance " + std::to_string(path[i]) + " is no group, it has nothing below");
        id.group = below.index();
    }
}

InstanceId SceneEditor::findOwn(const std::vector<uint32_t>& path) {
    find(path);  // throws before anything is copied
    InstanceId id{scene_.root, path[0]};
    for (size_t i = 0;; ++i) {
        id.index = path[i];
        if (i + 1 == path.size()) return id;
        ChildRef below = child(id);
        if (uses_[below.index()].count > 1) {
            const uint32_t copy = uint32_t(scene_.groups.size());
            scene_.groups.push_back(scene_.groups[below.index()]);
            const OpenGroup* source = open_[below.index()].get();
            open_.push_back(source ? std::make_unique<OpenGroup>(*source) : nullptr);
            uses_.emplace_back();
            holders_.emplace_back();
            Group& group = scene_.groups[copy];
            group.as_child = {group.bounds, group.area, group.max_triangle_area};
            if (group.copy_of.empty()) group.copy_of = group.name;
            group.name = freeName(scene_, group.copy_of);
            scene_.names[group.name] = ChildRef::group(copy);
            for (uint32_t k = 0; k < group.instances.size(); ++k) {
                const ChildRef inner = group.instances.child(k);
                if (!inner.isNone()) addUse({copy, group.listed_index[k]}, inner);
            }
            const uint32_t slot = slotOf(id);
            removeUse(id, below);
            below = ChildRef::group(copy);
            scene_.groups[id.group].instances.setChild(slot, below);
            markEdited(id);
            addUse(id, below);
            refreshUpwards(id.group, open_[id.group]->node_of[slot]);
        }
        id.group = below.index();
    }
}

void SceneEditor::markEdited(InstanceId id) {
    std::vector<bool>& edited = scene_.groups[id.group].edited;
    if (edited.size() <= id.index) edited.resize(scene_.groups[id.group].next_index, false);
    edited[id.index] = true;
}

void SceneEditor::place(InstanceId id, ChildRef child, const Affine& group_from_child) {
    addUse(id, child);
    markEdited(id);
    DVec3 center, half;
    instanceBox(childSums(scene_, child), group_from_child, center, half);
    const uint32_t node = chooseNode(scene_.groups[id.group], center, half);
    addResident(id.group, node, id.index, child, group_from_child);
    uint32_t changed = node;
    if (scene_.groups[id.group].nodes[node].child_count == 0 &&
        scene_.groups[id.group].nodes[node].resident_count > kMostResidents) {
        split(id.group, node);
        changed = rebuildIfTooDeep(id.group, scene_.groups[id.group].nodes[node].first_child);
    }
    const bool is_group = child.isGroup();
    countInstances(id.group, is_group ? scene_.groups[child.index()].instances_total : 1.0,
                   is_group ? scene_.groups[child.index()].triangles_total
                            : double(scene_.meshes[child.index()].triangles.size()));
    if (is_group) {
        int& depth = scene_.groups[id.group].depth;
        depth = std::max(depth, scene_.groups[child.index()].depth + 1);
    }
    refreshUpwards(id.group, changed);
}

void SceneEditor::take(InstanceId id) {
    OpenGroup& open = *open_[id.group];
    Group& group = scene_.groups[id.group];
    const uint32_t slot = open.slot_of[id.index], node_index = open.node_of[slot];
    const ChildRef child = group.instances.child(slot);
    removeUse(id, child);
    markEdited(id);
    const bool is_group = child.isGroup();
    countInstances(id.group, is_group ? -scene_.groups[child.index()].instances_total : -1.0,
                   is_group ? -scene_.groups[child.index()].triangles_total
                            : -double(scene_.meshes[child.index()].triangles.size()));
    GroupNode& node = group.nodes[node_index];
    const uint32_t last = node.first + node.resident_count - 1;
    for (uint32_t i = slot; i < last; ++i) {
        group.instances.swap(i, i + 1);
        group.listed_index[i] = group.listed_index[i + 1];
        open.slot_of[group.listed_index[i]] = i;
    }
    group.instances.erase(last);
    open.slot_of[id.index] = kGone;
    --node.resident_count;
    if (node.free_count < 0xffff) ++node.free_count;
    // Few below the parent: one leaf again.
    uint32_t start = node_index;
    while (start != 0 && group.nodes[start].child_count == 0) {
        const uint32_t parent = open.parent[start];
        const GroupNode& p = group.nodes[parent];
        uint32_t count = p.resident_count;
        bool has_leaves = true;
        for (uint32_t c = p.first_child; c < p.first_child + p.child_count; ++c) {
            has_leaves &= group.nodes[c].child_count == 0;
            count += group.nodes[c].resident_count;
        }
        if (!has_leaves || count > open.merge_at[parent]) break;
        collapse(id.group, parent);
        start = parent;
    }
    refreshUpwards(id.group, start);
}

// The order of residents: as they were when the group was opened, then as they came. What goes and
// comes again finds its old place, on which points depend.
bool SceneEditor::isBefore(const OpenGroup& open, uint32_t name_a, uint32_t name_b) {
    const auto rank = [&](uint32_t name) {
        return name < open.rank_of.size() ? open.rank_of[name] : name;
    };
    return std::pair(rank(name_a), name_a) < std::pair(rank(name_b), name_b);
}

// Down to the child that must grow least; what is about as large as a node stays in it.
uint32_t SceneEditor::chooseNode(const Group& group, const DVec3& center, const DVec3& half) const {
    uint32_t index = 0;
    const Vec3 lo = Vec3(center - half), hi = Vec3(center + half);
    const float size = float(2.0 * glm::length(half));
    for (;;) {
        const GroupNode& node = group.nodes[index];
        if (node.child_count == 0) return index;
        const bool is_full = node.resident_count > kMostResidents;
        if (!is_full && size > 0.5f * glm::length(node.bounds.extent())) return index;
        float least = kInfinity;
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const Box3& b = group.nodes[c].bounds;
            float growth = 0.0f;  // of the sum of its sides; then what is nearest
            if (!b.isEmpty()) {
                const Vec3 extent = glm::max(b.max, hi) - glm::min(b.min, lo) - b.extent();
                growth =
                    extent.x + extent.y + extent.z + 1e-6f * glm::length(b.center() - Vec3(center));
            } else {
                growth = size;
            }
            if (growth < least) least = growth, index = c;
        }
    }
}

// capacity: places of a power of two are used again.
uint32_t SceneEditor::takePlaces(uint32_t group_index, uint32_t capacity) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t>& free = open.free_places[size_t(std::countr_zero(capacity))];
    if (std::has_single_bit(capacity) && !free.empty()) {
        const uint32_t first = free.back();
        free.pop_back();
        return first;
    }
    const uint32_t first = uint32_t(group.instances.size());
    group.instances.addEmpty(capacity);
    group.listed_index.resize(first + capacity, kGone);
    open.node_of.resize(first + capacity, kGone);
    return first;
}

void SceneEditor::freePlaces(uint32_t group, uint32_t first, uint32_t capacity) {
    // Places from building come in any number: in pieces.
    while (capacity > 0) {
        const uint32_t piece = std::bit_floor(capacity);
        open_[group]->free_places[size_t(std::countr_zero(piece))].push_back(first);
        first += piece;
        capacity -= piece;
    }
}

// To a free place of a node.
void SceneEditor::moveResident(uint32_t group_index, uint32_t from, uint32_t to, uint32_t node) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    group.instances.swap(from, to);
    group.listed_index[to] = group.listed_index[from];
    open.slot_of[group.listed_index[to]] = to;
    open.node_of[to] = node;
}

void SceneEditor::addResident(uint32_t group_index, uint32_t node_index, uint32_t name,
                              ChildRef child, const Affine& group_from_child) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    if (group.nodes[node_index].free_count == 0) {
        const uint32_t count = group.nodes[node_index].resident_count;
        const uint32_t capacity = std::min(capacityFor(count + 1), count + 0x8000);
        const uint32_t to = takePlaces(group_index, capacity);
        const uint32_t first = group.nodes[node_index].first;
        for (uint32_t i = 0; i < count; ++i)
            moveResident(group_index, first + i, to + i, node_index);
        GroupNode& node = group.nodes[node_index];
        freePlaces(group_index, node.first, count);
        node.first = to;
        node.free_count = uint16_t(capacity - count);
    }
    GroupNode& node = group.nodes[node_index];
    --node.free_count;
    uint32_t slot = node.first + node.resident_count++;
    for (; slot > node.first && isBefore(open, name, group.listed_index[slot - 1]); --slot) {
        group.instances.swap(slot, slot - 1);
        group.listed_index[slot] = group.listed_index[slot - 1];
        open.slot_of[group.listed_index[slot]] = slot;
        open.node_of[slot] = node_index;
    }
    group.instances.set(slot, child, group_from_child);
    group.listed_index[slot] = name;
    open.slot_of[name] = slot;
    open.node_of[slot] = node_index;
}

uint32_t SceneEditor::takeNodes(uint32_t group_index, uint32_t count) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t>& free = open.free_nodes[count];
    if (!free.empty()) {
        const uint32_t first = free.back();
        free.pop_back();
        return first;
    }
    const uint32_t first = uint32_t(group.nodes.size());
    group.nodes.resize(first + count);
    open.parent.resize(first + count, 0);
    open.merge_at.resize(first + count, 0);
    return first;
}

namespace {

// Cuts members into two halves at the median of the axis along which they are spread most, these
// again, and so on; what comes out is eight lists at most, each in its old order.
void cutInHalves(const std::vector<DVec3>& centers, std::vector<uint32_t> members, int cuts,
                 std::vector<std::vector<uint32_t>>& parts) {
    if (cuts == 0 || members.size() < 2) {
        std::sort(members.begin(), members.end());
        parts.push_back(std::move(members));
        return;
    }
    DBox3 box;
    for (const uint32_t i : members) box.extend(centers[i]);
    const DVec3 extent = box.extent();
    const int axis =
        extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
    const auto middle = members.begin() + std::ptrdiff_t(members.size() / 2);
    std::nth_element(members.begin(), middle, members.end(), [&](uint32_t a, uint32_t b) {
        return std::pair(centers[a][axis], a) < std::pair(centers[b][axis], b);
    });
    cutInHalves(centers, {members.begin(), middle}, cuts - 1, parts);
    cutInHalves(centers, {middle, members.end()}, cuts - 1, parts);
}

}  // namespace

// A leaf's residents go to eight children of as many each, and those are split in turn.
void SceneEditor::split(uint32_t group_index, uint32_t node_index) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    const uint32_t n = group.nodes[node_index].resident_count,
                   first = group.nodes[node_index].first;
    std::vector<DVec3> centers(n);
    std::vector<uint32_t> all(n);
    for (uint32_t i = 0; i < n; ++i) {
        DVec3 half;
        instanceBox(childSums(scene_, group.instances.child(first + i)),
                    group.instances.groupFromChild(first + i), centers[i], half);
        all[i] = i;
    }
    std::vector<std::vector<uint32_t>> parts;
    cutInHalves(centers, std::move(all), 3, parts);
    const uint32_t first_child = takeNodes(group_index, uint32_t(parts.size()));
    for (uint32_t p = 0; p < parts.size(); ++p) {
        const uint32_t c = first_child + p;
        const uint32_t count = uint32_t(parts[p].size()),
                       capacity = std::min(capacityFor(count), count + 0x8000);
        GroupNode child;
        child.first = takePlaces(group_index, capacity);
        child.free_count = uint16_t(capacity - count);
        for (const uint32_t i : parts[p])
            moveResident(group_index, first + i, child.first + child.resident_count++, c);
        open.parent[c] = node_index;
        group.nodes[c] = child;
        if (count > kMostResidents) split(group_index, c);
        accumulateNode(
            group, group.nodes, [&](ChildRef r) { return childSums(scene_, r); }, group.nodes[c]);
        note(group_index, c);
    }
    GroupNode& node = group.nodes[node_index];
    freePlaces(group_index, node.first, placesOf(node));
    node.first = node.resident_count = 0;
    node.free_count = 0;
    node.first_child = first_child;
    node.child_count = uint8_t(parts.size());
    open.merge_at[node_index] = kMostResidents;
}

// All below the node into one leaf.
void SceneEditor::collapse(uint32_t group_index, uint32_t node_index) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t> nodes{node_index}, slots;
    for (size_t i = 0; i < nodes.size(); ++i) {
        const GroupNode& node = group.nodes[nodes[i]];
        for (uint32_t r = 0; r < node.resident_count; ++r) slots.push_back(node.first + r);
        for (uint32_t c = 0; c < node.child_count; ++c) nodes.push_back(node.first_child + c);
    }
    std::sort(slots.begin(), slots.end(), [&](uint32_t a, uint32_t b) {
        return isBefore(open, group.listed_index[a], group.listed_index[b]);
    });
    const uint32_t count = uint32_t(slots.size()),
                   capacity = std::min(capacityFor(count), count + 0x8000),
                   to = takePlaces(group_index, capacity);
    for (uint32_t i = 0; i < count; ++i) moveResident(group_index, slots[i], to + i, node_index);
    for (const uint32_t n : nodes) {
        GroupNode& node = group.nodes[n];
        freePlaces(group_index, node.first, placesOf(node));
        if (node.child_count > 0) open.free_nodes[node.child_count].push_back(node.first_child);
        node = GroupNode();
        note(group_index, n);
    }
    GroupNode& node = group.nodes[node_index];
    node.first = to;
    node.resident_count = count;
    node.free_count = uint16_t(capacity - count);
}

// Based on: Galperin, Rivest. Scapegoat Trees. 1993. Where a leaf lies deeper than twice what would
// do, the lowest node above it that is to blame is made anew. Returns the node below which all sums
// are right: that one, or the leaf's parent.
uint32_t SceneEditor::rebuildIfTooDeep(uint32_t group_index, uint32_t leaf) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    // A tree of eight children a node has half of these levels.
    const auto mostLevels = [](uint32_t count) {
        return 1.0 + std::log2(std::max(count / 8.0, 1.0)) / 2.0;
    };
    int depth = 0;
    for (uint32_t n = leaf; n != 0; n = open.parent[n]) ++depth;
    const double allowed =
        std::max(mostLevels(group.nodes[0].count), double(open.built_height + 1));
    if (depth <= allowed) return open.parent[leaf];
    int levels = 1;
    uint32_t node = open.parent[leaf];
    for (; node != 0; node = open.parent[node], ++levels) {
        if (levels > mostLevels(group.nodes[node].count)) break;
    }
    collapse(group_index, node);
    if (group.nodes[node].resident_count > kMostResidents) split(group_index, node);
    return node;
}

void SceneEditor::note(uint32_t group, uint32_t node) {
    changes_.any = true;
    if (changes_.all_nodes) return;
    changes_.nodes.push_back({group, node});
    if (changes_.nodes.size() > kMostChanges) {
        changes_.all_nodes = true;
        changes_.nodes.clear();
    }
}

void SceneEditor::refreshUpwards(uint32_t group_index, uint32_t node_index) {
    OpenGroup& open = *open_[group_index];
    Group& group = scene_.groups[group_index];
    for (;;) {
        accumulateNode(
            group, group.nodes, [&](ChildRef r) { return childSums(scene_, r); },
            group.nodes[node_index]);
        note(group_index, node_index);
        if (node_index == 0) break;
        node_index = open.parent[node_index];
    }
    const GroupNode& root = group.nodes[0];
    group.area = root.area;
    group.max_triangle_area = root.max_triangle_area;
    group.bounds =
        root.area > 0.0 ? DBox3{DVec3(root.bounds.min), DVec3(root.bounds.max)} : DBox3();
    groupChanged(group_index);
}

// Lets the groups that instance it know.
void SceneEditor::groupChanged(uint32_t index) {
    Group& group = scene_.groups[index];
    const ChildSums now = {group.bounds, group.area, group.max_triangle_area};
    const Uses uses = uses_[index];
    if (uses.count == 0) {
        group.as_child = now;
    } else if (uses.count <= kFewUses && uses.places.size() == uses.count) {
        group.as_child = now;
        for (const InstanceId& use : uses.places) {
            const uint32_t slot = slotOf(use);
            refreshUpwards(use.group, open_[use.group]->node_of[slot]);
        }
    } else {
        const ChildSums& was = group.as_child;
        const bool fits = now.bounds.isEmpty() ||
                          (!was.bounds.isEmpty() &&
                           glm::all(glm::greaterThanEqual(now.bounds.min, was.bounds.min)) &&
                           glm::all(glm::lessThanEqual(now.bounds.max, was.bounds.max)));
        if (fits && now.max_triangle_area <= was.max_triangle_area && now.area <= 2.0 * was.area &&
            now.area >= 0.5 * was.area) {
            if (untold_.empty() || untold_.back() != index) untold_.push_back(index);
            return;
        }
        group.as_child = now;
        const std::map<uint32_t, size_t> holders = holders_[index];
        for (const auto& [holder, count] : holders) refreshAll(holder);
    }
}

// All nodes anew, children before parents.
void SceneEditor::refreshAll(uint32_t group_index) {
    Group& group = scene_.groups[group_index];
    std::vector<uint32_t> order{0};
    for (size_t i = 0; i < order.size(); ++i) {
        const GroupNode& node = group.nodes[order[i]];
        for (uint32_t c = 0; c < node.child_count; ++c) order.push_back(node.first_child + c);
    }
    for (size_t i = order.size(); i-- > 1;) {
        accumulateNode(
            group, group.nodes, [&](ChildRef r) { return childSums(scene_, r); },
            group.nodes[order[i]]);
        note(group_index, order[i]);
    }
    opened(group_index);
    refreshUpwards(group_index, 0);
}

// Numbers for people: in all groups above, too.
void SceneEditor::countInstances(uint32_t index, double instances, double triangles) {
    scene_.groups[index].instances_total += instances;
    scene_.groups[index].triangles_total += triangles;
    for (const auto& [holder, count] : holders_[index])
        countInstances(holder, instances * double(count), triangles * double(count));
}

SceneChanges SceneEditor::takeChanges() {
    SceneChanges changes = std::exchange(changes_, {});
    const std::vector<uint32_t> untold = std::exchange(untold_, {}),
                                rebuilt = std::exchange(rebuilt_, {});
    if (!changes.any) return changes;
    std::vector<uint32_t> changed = untold, around_untold = rebuilt, around_stale;
    changed.insert(changed.end(), rebuilt.begin(), rebuilt.end());
    for (const SceneChanges::Node& node : changes.nodes) changed.push_back(node.group);
    const auto addHolders = [&](uint32_t group, std::vector<uint32_t>& groups) {
        for (const auto& [holder, count] : holders_[group]) groups.push_back(holder);
    };
    for (const uint32_t group : untold) addHolders(group, around_untold);
    for (uint32_t g = 0; g < scene_.groups.size(); ++g) {
        if (scene_.groups[g].area != scene_.groups[g].as_child.area) addHolders(g, around_stale);
    }
    changes.groups = withHolders(std::move(changed));
    changes.whole_groups = withHolders(std::move(around_untold));
    changes.stale_groups = withHolders(std::move(around_stale));
    return changes;
}

}  // namespace stipple
