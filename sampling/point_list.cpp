// SPDX-License-Identifier: Apache-2.0
#include <sampling/point_list.h>

#include <algorithm>
#include <bit>
#include <numeric>
#include <utility>

namespace stipple {

PointLists::List PointLists::List::make(uint32_t block_count) {
    List list;
    list.bits_ = reinterpret_cast<uintptr_t>(new ListBlock[block_count]) |
                 uintptr_t(std::countr_zero(block_count));
    return list;
}

namespace {

template <class T>
void resizeAtomics(std::vector<std::atomic<T>>& values, size_t size) {
    if (values.size() >= size) return;
    std::vector<std::atomic<T>> more(size);
    for (size_t i = 0; i < values.size(); ++i) more[i] = values[i].load();
    values = std::move(more);
}

}  // namespace

PointLists::PointLists(const Scene& scene)
    : scene_(scene), seen_(scene.meshes.size() * kDirections), factor_of_(scene.groups.size()) {
    constexpr uint32_t kOften = 8;
    std::vector<uint32_t> uses(scene.groups.size(), 0);
    for (const Group& group : scene.groups) {
        for (size_t i = 0; i < group.instances.size(); ++i) {
            const ChildRef child = group.instances.child(i);
            if (!child.isNone() && child.isGroup()) ++uses[child.index()];
        }
    }
    for (const Mesh& mesh : scene.meshes) mesh_slots_.emplace_back(mesh.nodes.size());
    for (size_t g = 0; g < scene.groups.size(); ++g) {
        const Group& group = scene.groups[g];
        group_slots_.emplace_back(uses[g] >= kOften ? group.nodes.size() : 0);
        edits_.names.push_back(uses[g] >= kOften ? group.listed_index : std::vector<uint32_t>());
    }
    for (const Group& group : scene.groups) is_deep_.push_back(group.depth > 1);
    findStale();
}

// Children before parents is not how groups are stored: a walk that remembers.
void PointLists::findStale() {
    const std::vector<Group>& groups = scene_.groups;
    is_stale_.assign(groups.size(), false);
    const auto isChanged = [&](const Group& group) { return group.area != group.as_child.area; };
    if (std::none_of(groups.begin(), groups.end(), isChanged)) return;
    // As deep as groups are nested, at most.
    for (bool is_new = true; is_new;) {
        is_new = false;
        for (size_t g = 0; g < groups.size(); ++g) {
            const InstanceStore& instances = groups[g].instances;
            for (size_t i = 0; !is_stale_[g] && groups[g].depth > 1 && i < instances.size(); ++i) {
                const ChildRef child = instances.child(i);
                if (child.isNone() || !child.isGroup()) continue;
                if (is_stale_[child.index()] || isChanged(groups[child.index()]))
                    is_stale_[g] = is_new = true;
            }
        }
    }
}

PointLists::~PointLists() {
    forEachSlot([](Slot& slot) { slot.list.load().destroy(); });
    dropOutdated();
    freeRetired();
    for (auto& seen : seen_) delete seen.load();
}

template <class Visit>
void PointLists::forEachSlot(const Visit& visit) {
    for (auto* all : {&mesh_slots_, &group_slots_}) {
        for (Slots& slots : *all) {
            for (Slot& slot : slots) visit(slot);
        }
    }
    for (auto& seen : seen_) {
        if (!seen.load()) continue;
        visit(seen.load()->slot);
    }
}

PointLists::Seen& PointLists::seen(uint32_t mesh_index, int direction) {
    std::atomic<Seen*>& place = seen_[mesh_index * kDirections + uint32_t(direction)];
    if (Seen* seen = place.load(std::memory_order_acquire)) {
        if (seen->last_used.load(std::memory_order_relaxed) != frame_)
            seen->last_used.store(frame_, std::memory_order_relaxed);
        return *seen;
    }
    const std::lock_guard lock(
        seen_stripes_[(mesh_index * kDirections + uint32_t(direction)) % kStripes]);
    if (Seen* seen = place.load(std::memory_order_acquire)) return *seen;
    const Mesh& mesh = scene_.meshes[mesh_index];
    auto seen = std::make_unique<Seen>();
    seen->area =
        measureVisibleArea(mesh, scene_.materials, scene_.textures, directionOf(direction));
    seen->last_used = frame_;
    visible_bytes_ += seen->bytes();
    place.store(seen.get(), std::memory_order_release);
    return *seen.release();
}

const VisibleArea& PointLists::visibleArea(uint32_t mesh, int direction) {
    return seen(mesh, direction).area;
}

namespace {

// Layers behind each other are about as many from anywhere; from these directions they are counted.
constexpr int kFactorDirections[] = {3, 14, 25};
// Metres. Octaves beyond a mesh's own are as its last.
constexpr float kFirstFactorSpacing = 1.0f / 256;

template <class At>
void addTable(SpacingTable& sum, double weight, const At& at) {
    float spacing = sum.first_spacing;
    for (float& factor : sum.factors) {
        factor += float(weight) * at(spacing);
        spacing *= 2.0f;
    }
}

}  // namespace

SpacingTable PointLists::makeFactor(ChildRef child) {
    SpacingTable table;
    table.first_spacing = kFirstFactorSpacing;
    if (!child.isGroup()) {
        const bool is_plant = hidesItself(scene_.meshes[child.index()]);
        for (const int direction : kFactorDirections) {
            constexpr double kShare = 1.0 / double(std::size(kFactorDirections));
            addTable(table, kShare, [&](float spacing) {
                if (!is_plant) return 1.0f;
                return visibleArea(child.index(), direction).whole_factor.at(spacing);
            });
        }
        return table;
    }
    const Group& group = scene_.groups[child.index()];
    std::map<uint32_t, double> areas;  // of its children
    double sum = 0.0;
    for (size_t i = 0; i < group.instances.size(); ++i) {
        const ChildRef inner = group.instances.child(i);
        if (inner.isNone()) continue;
        const double area = childArea(scene_, inner) * group.instances.areaScale(i);
        areas[inner.bits] += area;
        sum += area;
    }
    for (const auto& [bits, area] : areas) {
        const SpacingTable& inner = factorOf(ChildRef{bits});
        addTable(table, area / std::max(sum, 1e-300),
                 [&](float spacing) { return inner.at(spacing); });
    }
    return table;
}

const SpacingTable& PointLists::factorOf(ChildRef child) {
    const auto found = factors_.find(child.bits);
    if (found != factors_.end()) return found->second;
    const SpacingTable made = makeFactor(child);
    return factors_.emplace(child.bits, made).first->second;
}

const SpacingTable& PointLists::wholeFactor(uint32_t group) {
    if (const SpacingTable* known = factor_of_[group].load(std::memory_order_acquire))
        return *known;
    const std::lock_guard lock(factor_mutex_);
    const SpacingTable& made = factorOf(ChildRef::group(group));
    factor_of_[group].store(&made, std::memory_order_release);
    return made;
}

PointLists::Slot& PointLists::slotOf(const ListName& name) {
    const uint32_t index = name.child.index();
    if (name.direction != ListName::kWhole) return seen(index, name.direction).slot;
    return (name.child.isGroup() ? group_slots_ : mesh_slots_)[index][name.node];
}

void PointLists::drop(Slot& slot) {
    List list = slot.list.exchange(List());
    bytes_ -= list.blockCount() * sizeof(ListBlock);
    list.destroy();
}

void PointLists::freeRetired() {
    for (List& list : retired_) list.destroy();
    retired_.clear();
    bytes_ -= std::exchange(retired_bytes_, 0);
}

void PointLists::putAside(const ListName& name, bool is_whole) {
    Slot& slot = slotOf(name);
    if (slot.last_used.load() != frame_) {
        drop(slot);
        return;
    }
    const List list = slot.list.exchange(List());
    if (list.isNull()) return;
    bytes_ -= list.blockCount() * sizeof(ListBlock);
    outdated_.push_back({name, list, is_whole});
}

void PointLists::putGroupAside(uint32_t group) {
    for (Outdated& outdated : outdated_)
        outdated.is_whole |= outdated.name.child == ChildRef::group(group);
    Slots& slots = group_slots_[group];
    for (uint32_t node = 0; node < slots.size(); ++node)
        putAside({ChildRef::group(group), node}, true);
}

void PointLists::dropOutdated() {
    for (Outdated& outdated : outdated_) outdated.list.destroy();
    outdated_.clear();
}

void PointLists::sceneChanged(const SceneChanges& changes) {
    const size_t n_groups = scene_.groups.size();
    while (mesh_slots_.size() < scene_.meshes.size())
        mesh_slots_.emplace_back(scene_.meshes[mesh_slots_.size()].nodes.size());
    // What has come since is instanced too seldom to have lists.
    while (group_slots_.size() < n_groups) group_slots_.emplace_back(0);
    edits_.names.resize(n_groups);
    resizeAtomics(seen_, scene_.meshes.size() * kDirections);
    resizeAtomics(factor_of_, n_groups);
    std::vector<uint32_t> changed = changes.groups, whole = changes.whole_groups;
    if (changes.all_nodes) {
        changed.resize(n_groups);
        std::iota(changed.begin(), changed.end(), 0);
        whole = changed;
    }
    is_stale_.assign(n_groups, false);
    for (const uint32_t group : changes.stale_groups) is_stale_[group] = true;
    is_deep_.resize(n_groups, false);
    for (const uint32_t group : changed) {
        factors_.erase(ChildRef::group(group).bits);
        factor_of_[group] = nullptr;
        // Points name their instances otherwise then.
        if (is_deep_[group] != (scene_.groups[group].depth > 1)) {
            is_deep_[group].flip();
            putGroupAside(group);
        }
    }
    for (const uint32_t group : whole) {
        putGroupAside(group);
        if (!group_slots_[group].empty()) edits_.names[group] = scene_.groups[group].listed_index;
    }
    for (const SceneChanges::Node& changed_node : changes.nodes) {
        edits_.nodes.emplace(changed_node.group, changed_node.node);
        if (changed_node.node < group_slots_[changed_node.group].size())
            putAside({ChildRef::group(changed_node.group), changed_node.node}, false);
    }
    for (const InstanceId& id : changes.instances) edits_.instances.emplace(id.group, id.index);
    // To go through so many takes longer than to make lists anew; and where none waits for them,
    // edits are forgotten.
    constexpr size_t kMostEdits = 2048;
    if (outdated_.empty() || edits_.nodes.size() + edits_.instances.size() > kMostEdits) {
        for (Outdated& outdated : outdated_) outdated.is_whole = true;
        updateNames();
    }
    for (const uint32_t group : changed) {
        Slots& slots = group_slots_[group];
        const size_t n = scene_.groups[group].nodes.size();
        if (slots.empty() || slots.size() >= n) continue;
        Slots more(n);
        for (size_t i = 0; i < slots.size(); ++i) {
            more[i].list = slots[i].list.load();
            more[i].last_used = slots[i].last_used.load();
        }
        slots = std::move(more);
    }
}

void PointLists::startFrame(const ListIdentity& identity, size_t budget_bytes, ThreadPool& pool) {
    freeRetired();
    budget_ = budget_bytes;
    const bool is_new = !(identity == identity_);
    identity_ = identity;
    const auto dropLists = [&](bool also_used) {
        forEachSlot([&](Slot& slot) {
            if (also_used || slot.last_used.load() != frame_) drop(slot);
        });
    };
    if (is_full_.exchange(false)) dropLists(false);
    if (is_new || bytes_ > budget_) dropLists(true);
    for (auto& place : seen_) {
        Seen* seen = place.load();
        if (bytes() <= budget_) break;
        if (!seen || seen->last_used.load() == frame_) continue;
        visible_bytes_ -= seen->bytes();
        drop(seen->slot);
        delete place.exchange(nullptr);
    }
    ++frame_;
    if (is_new) dropOutdated();
    updateOutdated(pool);
}

// One block after the other, so that all threads share the work of a list.
void PointLists::updateOutdated(ThreadPool& pool) {
    struct Job {
        const Outdated* outdated;
        uint32_t block;
    };
    std::vector<Job> jobs;
    for (Outdated& outdated : outdated_) {
        const ListName& name = outdated.name;
        Slot& slot = slotOf(name);
        const uint32_t block_count = outdated.list.blockCount();
        const std::vector<GroupNode>& nodes = scene_.groups[name.child.index()].nodes;
        // A group that was built anew may have fewer.
        if (name.node >= nodes.size() || !(nodes[name.node].area > 0.0) ||
            !slot.list.load().isNull() || !hasLists(name.child) ||
            !takeBudget(block_count * sizeof(ListBlock))) {
            outdated.list.destroy();
            continue;
        }
        slot.list = outdated.list;
        slot.last_used = frame_;
        for (uint32_t b = 0; b < block_count; ++b) jobs.push_back({&outdated, b});
    }
    pool.forEach(jobs.size(), [&](size_t i, int) {
        const auto [outdated, b] = jobs[i];
        ListBlock& block = outdated->list.blocks()[b];
        const ListSource source = sourceOf(outdated->name);
        if (outdated->is_whole) {
            makeListPoints(source, b * kBlockPoints, kBlockPoints, block);
        } else {
            remakeListPoints(source, edits_, b * kBlockPoints, block);
        }
    });
    outdated_.clear();
    updateNames();
}

// As lists that are made from now on find them.
void PointLists::updateNames() {
    for (const auto& [g, n] : std::exchange(edits_.nodes, {})) {
        if (group_slots_[g].empty()) continue;
        const Group& group = scene_.groups[g];
        std::vector<uint32_t>& names = edits_.names[g];
        names.resize(group.listed_index.size());
        if (n >= group.nodes.size()) continue;
        const GroupNode& node = group.nodes[n];
        std::copy_n(group.listed_index.begin() + node.first, node.resident_count,
                    names.begin() + node.first);
    }
    edits_.instances.clear();
}

ListSource PointLists::sourceOf(const ListName& name) {
    const bool is_whole = name.direction == ListName::kWhole;
    return {scene_, identity_, name,
            is_whole ? nullptr : &visibleArea(name.child.index(), name.direction)};
}

bool PointLists::takeBudget(size_t bytes) {
    if (bytes_.fetch_add(bytes) + bytes + visible_bytes_ <= budget_) return true;
    bytes_ -= bytes;
    is_full_.store(true, std::memory_order_relaxed);
    return false;
}

PointLists::List PointLists::grow(Slot& slot, const ListName& name, uint32_t n_blocks) {
    const std::lock_guard lock(stripes_[(name.child.bits * 31 + name.node) % kStripes]);
    const List old = slot.list.load(std::memory_order_acquire);
    const uint32_t have = old.blockCount();
    if (have >= n_blocks) return old;
    const uint32_t capacity = std::bit_ceil(n_blocks);
    if (!takeBudget(capacity * sizeof(ListBlock))) return List();
    const List list = List::make(capacity);
    const ListSource source = sourceOf(name);
    std::copy_n(old.blocks(), have, list.blocks());
    for (uint32_t b = have; b < capacity; ++b)
        makeListPoints(source, b * kBlockPoints, kBlockPoints, list.blocks()[b]);
    slot.list.store(list, std::memory_order_release);
    if (have > 0) {
        // Other threads may still read it; it goes when the frame is over.
        const std::lock_guard retired_lock(mutex_);
        retired_bytes_ += have * sizeof(ListBlock);
        retired_.push_back(old);
    }
    return list;
}

const ListBlock& PointLists::points(const ListName& name, uint32_t first, int count,
                                    uint32_t list_length, ListBlock& scratch, int& first_lane) {
    const uint32_t block = first / kBlockPoints;
    if (budget_ > 0 && first < list_length) {
        Slot& slot = slotOf(name);
        List list = slot.list.load(std::memory_order_acquire);
        if (list.blockCount() <= block)
            list = grow(slot, name, (list_length + kBlockPoints - 1) / kBlockPoints);
        if (!list.isNull()) {
            if (slot.last_used.load(std::memory_order_relaxed) != frame_) {
                slot.last_used.store(frame_, std::memory_order_relaxed);
            }
            first_lane = int(first % kBlockPoints);
            return list.blocks()[block];
        }
    }
    makeListPoints(sourceOf(name), first, count, scratch);
    first_lane = 0;
    return scratch;
}

}  // namespace stipple
