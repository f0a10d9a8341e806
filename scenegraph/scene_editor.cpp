// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/scene_editor.h>

#include <scenegraph/group_build.h>
#include <scenegraph/group_sums.h>

#include <algorithm>
#include <exception>
#include <numeric>

namespace stipple {

namespace {

constexpr uint32_t kFewInstances = 12;  // below a node that was built: merged
constexpr double kFarthest = 1e30;      // m: boxes are of floats

// For a copy: "tile~2".
std::string freeName(const Scene& scene, const std::string& name) {
    for (int i = 2;; ++i) {
        std::string result = name + "~" + std::to_string(i);
        if (!scene.names.contains(result)) return result;
    }
}

// The most that an instance enlarges its child.
double lengthScale(const InstanceStore& instances, size_t i) {
    return instances.isSimilarity(i) ? std::sqrt(instances.areaScale(i))
                                     : maxLengthScale(instances.groupFromChild(i).linear);
}

[[noreturn]] void refuse(const std::string& what) {
    throw Error(ErrorCode::kInvalidArgument, "", what);
}

}  // namespace

SceneEditor::SceneEditor(Scene& scene) : scene_(scene) {
    open_.resize(scene.groups.size());
    uses_.resize(scene.groups.size());
    holders_.resize(scene.groups.size());
    outgrown_.resize(scene.groups.size(), 0.0);
    for (uint32_t g = 0; g < scene.groups.size(); ++g) {
        const Group& group = scene.groups[g];
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef child = group.instances.child(i);
            if (!child.isNone() && child.isGroup())
                addUse({g, group.listed_index[i]}, child, lengthScale(group.instances, i));
        }
    }
}

void SceneEditor::addUse(InstanceId place, ChildRef child, double length_scale) {
    if (!child.isGroup()) return;
    Uses& uses = uses_[child.index()];
    if (++uses.count <= kFewUses) uses.places.push_back(place);
    Held& held = holders_[child.index()][place.group];
    ++held.count;
    held.length_scale = std::max(held.length_scale, length_scale);
}

void SceneEditor::removeUse(InstanceId place, ChildRef child) {
    if (!child.isGroup()) return;
    Uses& uses = uses_[child.index()];
    --uses.count;
    std::erase(uses.places, place);
    std::map<uint32_t, Held>& holders = holders_[child.index()];
    const auto found = holders.find(place.group);
    if (--found->second.count == 0) holders.erase(found);
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
        if (group.instances.child(i).isNone()) continue;
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
        for (const auto& [holder, held] : holders_[g]) groups.push_back(holder);
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
        if (scene_.groups[child.index()].depth + 1 + depthAbove(group) > kDeepestNesting)
            refuse("groups would be nested more than " + std::to_string(kDeepestNesting) + " deep");
    }
    DVec3 center, half;
    if (instanceBox(childSums(scene_, child), transform, center, half)) {
        const DVec3 far = glm::abs(center) + half;
        if (!(std::max({far.x, far.y, far.z}) < kFarthest))
            refuse("what it places would reach beyond 1e30 m");
    }
}

// Levels of groups that hold the group.
int SceneEditor::depthAbove(uint32_t group) const {
    std::vector<uint32_t> around = withHolders({group});
    std::sort(around.begin(), around.end(), [&](uint32_t a, uint32_t b) {
        return scene_.groups[a].depth < scene_.groups[b].depth;
    });
    std::map<uint32_t, int> above;
    int most = 0;
    for (const uint32_t g : around) {
        most = std::max(most, above[g]);
        for (const auto& [holder, held] : holders_[g])
            above[holder] = std::max(above[holder], above[g] + 1);
    }
    return most;
}

// At least that deep; what holds it, deeper.
void SceneEditor::deepen(uint32_t group, int depth) {
    std::vector<std::pair<uint32_t, int>> open{{group, depth}};
    while (!open.empty()) {
        const auto [g, least] = open.back();
        open.pop_back();
        if (scene_.groups[g].depth >= least) continue;
        scene_.groups[g].depth = least;
        for (const auto& [holder, held] : holders_[g]) open.emplace_back(holder, least + 1);
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
    checkInsert(id.group, what, group_from_child);
    take(id);
    place(id, what, group_from_child);
}

void SceneEditor::check(InstanceId id, ChildRef child, const Affine& group_from_child) {
    slotOf(id);
    checkInsert(id.group, child, group_from_child);
}

void SceneEditor::replace(InstanceId id, ChildRef child) {
    const Affine where = groupFromChild(id);
    checkInsert(id.group, child, where);
    take(id);
    place(id, child, where);
}

namespace {

// What one thread takes of many instances at a time.
constexpr size_t kChunkInstances = 4096;

size_t chunksOf(const std::vector<SceneEditor::NewInstance>& instances) {
    return (instances.size() + kChunkInstances - 1) / kChunkInstances;
}

template <class Visit>
void forChunk(const std::vector<SceneEditor::NewInstance>& instances, size_t chunk,
              const Visit& visit) {
    const size_t end = std::min(instances.size(), (chunk + 1) * kChunkInstances);
    for (size_t i = chunk * kChunkInstances; i < end; ++i) visit(instances[i]);
}

}  // namespace

// Throws what the first that cannot be inserted is refused for, whatever the threads.
void SceneEditor::checkInserts(uint32_t group, const std::vector<NewInstance>& instances,
                               ThreadPool& pool) const {
    std::vector<std::exception_ptr> errors(chunksOf(instances));
    pool.forEach(errors.size(), [&](size_t chunk, int) {
        try {
            forChunk(instances, chunk, [&](const NewInstance& i) {
                checkInsert(group, i.child, i.group_from_child);
            });
        } catch (...) {
            errors[chunk] = std::current_exception();
        }
    });
    for (const std::exception_ptr& error : errors) {
        if (error) std::rethrow_exception(error);
    }
}

InstanceId SceneEditor::insertMany(uint32_t group_index, const std::vector<NewInstance>& instances,
                                   ThreadPool& pool) {
    checkInserts(group_index, instances, pool);
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
    group.instances.addChunks(pool, chunksOf(instances), [&](size_t chunk, InstanceStore& store) {
        forChunk(instances, chunk,
                 [&](const NewInstance& i) { store.add(i.child, i.group_from_child); });
    });
    for (const NewInstance& i : instances) {
        const InstanceId id{group_index, group.next_index};
        addUse(id, i.child, maxLengthScale(i.group_from_child.linear));
        group.listed_index.push_back(group.next_index++);
        markEdited(id);
    }
    const ChildSums as_child = group.as_child;
    const int depth_before = group.depth;
    buildGroup(scene_, group, scene_.path + ": /groups/" + group.name, pool);
    group.as_child = as_child;
    updateSlack(group_index);
    group.bounds = sumBounds(group);
    deepen(group_index, std::exchange(group.depth, depth_before));
    open_[group_index].reset();
    opened(group_index);
    rebuilt_.push_back(group_index);
    changes_.any = changes_.anywhere = true;
    const double more_instances = group.instances_total - instances_before,
                 more_triangles = group.triangles_total - triangles_before;
    group.instances_total = instances_before, group.triangles_total = triangles_before;
    countInstances(group_index, more_instances, more_triangles);
    Dirty dirty;
    groupChanged(group_index, dirty);
    refresh(std::move(dirty));
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
    outgrown_.resize(n_groups, 0.0);
    for (Group& group : asset.groups) {
        const uint32_t index = uint32_t(scene_.groups.size());
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef inner = renamed(group.instances.child(i));
            group.instances.setChild(i, inner);
            if (!inner.isNone() && inner.isGroup())
                addUse({index, group.listed_index[i]}, inner, lengthScale(group.instances, i));
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
            outgrown_.push_back(0.0);
            Group& group = scene_.groups[copy];
            group.as_child = {group.bounds, group.area, group.max_triangle_area};
            if (group.copy_of.empty()) group.copy_of = group.name;
            group.name = freeName(scene_, group.copy_of);
            scene_.names[group.name] = ChildRef::group(copy);
            for (uint32_t k = 0; k < group.instances.size(); ++k) {
                const ChildRef inner = group.instances.child(k);
                if (!inner.isNone() && inner.isGroup())
                    addUse({copy, group.listed_index[k]}, inner, lengthScale(group.instances, k));
            }
            const uint32_t slot = slotOf(id);
            removeUse(id, below);
            below = ChildRef::group(copy);
            scene_.groups[id.group].instances.setChild(slot, below);
            markEdited(id);
            noteMember(id);
            addUse(id, below, lengthScale(scene_.groups[id.group].instances, slot));
            updateSlack(id.group);
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

void SceneEditor::addDirty(uint32_t group, uint32_t node, Dirty& dirty) const {
    dirty[{scene_.groups[group].depth, group}].push_back(node);
}

void SceneEditor::refresh(Dirty dirty) {
    while (!dirty.empty()) {
        const auto group = dirty.extract(dirty.begin());
        refreshNodes(group.key().second, group.mapped());
        groupChanged(group.key().second, dirty);
    }
}

namespace {

// The farthest that a point of one box lies outside of another.
double standsOutBy(const DBox3& box, const DBox3& of) {
    if (box.isEmpty()) return 0.0;
    if (of.isEmpty()) return kInfinity;
    return glm::length(glm::max(glm::max(of.min - box.min, box.max - of.max), DVec3(0.0)));
}

constexpr double kMostOutgrown = 0.25;  // of the length of its diagonal

}  // namespace

// Lets the groups that instance it know.
void SceneEditor::groupChanged(uint32_t index, Dirty& dirty) {
    Group& group = scene_.groups[index];
    const ChildSums now = {group.bounds, group.area, group.max_triangle_area};
    const Uses uses = uses_[index];
    if (uses.count == 0) {
        group.as_child = now;
    } else if (uses.count <= kFewUses && uses.places.size() == uses.count) {
        group.as_child = now;
        for (const InstanceId& use : uses.places) {
            const uint32_t slot = slotOf(use);
            addDirty(use.group, open_[use.group]->node_of[slot], dirty);
        }
    } else {
        const ChildSums& was = group.as_child;
        const double outgrown = standsOutBy(now.bounds, was.bounds);
        const bool fits =
            outgrown == 0.0 || outgrown <= kMostOutgrown * glm::length(was.bounds.extent());
        if (fits && now.max_triangle_area <= was.max_triangle_area && now.area <= 2.0 * was.area &&
            now.area >= 0.5 * was.area) {
            if (untold_.empty() || untold_.back() != index) untold_.push_back(index);
            setOutgrown(index, outgrown, dirty);
            return;
        }
        group.as_child = now;
        for (const auto& [holder, held] : holders_[index]) addDirty(holder, kGone, dirty);
    }
    setOutgrown(index, 0.0, dirty);
}

void SceneEditor::setOutgrown(uint32_t index, double length, Dirty& dirty) {
    if (std::exchange(outgrown_[index], length) == length) return;
    for (const auto& [holder, held] : holders_[index]) {
        if (updateSlack(holder)) dirty[{scene_.groups[holder].depth, holder}];
    }
}

// What it needs for all that it holds. Says whether that is another than before: then its bounds
// have to be set.
bool SceneEditor::updateSlack(uint32_t holder) {
    double slack = 0.0;
    for (uint32_t g = 0; g < holders_.size(); ++g) {
        if (!(outgrown_[g] > 0.0)) continue;
        const auto found = holders_[g].find(holder);
        if (found != holders_[g].end())
            slack = std::max(slack, outgrown_[g] * found->second.length_scale);
    }
    constexpr double kRounding = 1.01;
    Group& group = scene_.groups[holder];
    if (float(slack * kRounding) == group.slack) return false;
    group.slack = float(slack * kRounding);
    rebuilt_.push_back(holder);
    return true;
}

// Numbers for people: in all groups above, too, from the innermost outwards.
void SceneEditor::countInstances(uint32_t index, double instances, double triangles) {
    std::map<std::pair<int, uint32_t>, std::pair<double, double>> more;
    more[{scene_.groups[index].depth, index}] = {instances, triangles};
    while (!more.empty()) {
        const auto of_group = more.extract(more.begin());
        const uint32_t g = of_group.key().second;
        const auto [n_instances, n_triangles] = of_group.mapped();
        scene_.groups[g].instances_total += n_instances;
        scene_.groups[g].triangles_total += n_triangles;
        for (const auto& [holder, held] : holders_[g]) {
            auto& sum = more[{scene_.groups[holder].depth, holder}];
            sum.first += n_instances * double(held.count);
            sum.second += n_triangles * double(held.count);
        }
    }
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
        for (const auto& [holder, held] : holders_[group]) groups.push_back(holder);
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
