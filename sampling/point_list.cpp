// SPDX-License-Identifier: Apache-2.0
#include <sampling/point_list.h>

#include <core/image.h>
#include <core/octahedral.h>
#include <core/rng.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <numeric>
#include <utility>

namespace stipple {

uint32_t packOctahedral(const Vec3& n) {
    const Vec2 p = octahedralOf(n);
    const auto q = [](float v) { return uint32_t(std::lround((v * 0.5f + 0.5f) * 65535.0f)); };
    return q(p.x) | q(p.y) << 16;
}

Vec3 unpackOctahedral(uint32_t packed) {
    constexpr float kStep = 2.0f / 65535.0f;
    return octahedralNormal(float(packed & 0xffff) * kStep - 1.0f,
                            float(packed >> 16) * kStep - 1.0f);
}

uint32_t packPlace(Vec2 uv) {
    const auto q = [](float v) { return uint32_t(std::clamp(v, 0.0f, 1.0f) * 65535.0f + 0.5f); };
    return q(uv.x) | q(uv.y) << 16;
}

Vec2 unpackPlace(uint32_t p) { return Vec2(p & 0xffff, p >> 16) / 65535.0f; }

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

void PointLists::dropEdited(const ListName& name) {
    Slot& slot = slotOf(name);
    const List list = slot.list.load();
    if (!list.isNull() && slot.last_used.load() == frame_)
        dropped_.push_back({name, list.blockCount()});
    drop(slot);
}

void PointLists::dropGroup(uint32_t group) {
    Slots& slots = group_slots_[group];
    for (uint32_t node = 0; node < slots.size(); ++node) dropEdited({ChildRef::group(group), node});
}

void PointLists::sceneChanged(const SceneChanges& changes) {
    const size_t n_groups = scene_.groups.size();
    while (mesh_slots_.size() < scene_.meshes.size())
        mesh_slots_.emplace_back(scene_.meshes[mesh_slots_.size()].nodes.size());
    // What has come since is instanced too seldom to have lists.
    while (group_slots_.size() < n_groups) group_slots_.emplace_back(0);
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
            dropGroup(group);
        }
    }
    for (const uint32_t group : whole) dropGroup(group);
    for (const SceneChanges::Node& changed_node : changes.nodes) {
        if (changed_node.node < group_slots_[changed_node.group].size())
            dropEdited({ChildRef::group(changed_node.group), changed_node.node});
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
    if (is_new) dropped_.clear();
    remakeDropped(pool);
}

// One block after the other, so that all threads share the work of a list.
void PointLists::remakeDropped(ThreadPool& pool) {
    struct Job {
        ListName name;
        ListBlock* out;
        uint32_t block;
    };
    std::vector<Job> jobs;
    for (const auto& [name, block_count] : std::exchange(dropped_, {})) {
        Slot& slot = slotOf(name);
        const std::vector<GroupNode>& nodes = scene_.groups[name.child.index()].nodes;
        // A group that was built anew may have fewer.
        if (name.node >= nodes.size() || !(nodes[name.node].area > 0.0) ||
            !slot.list.load().isNull() || !hasLists(name.child) ||
            !takeBudget(block_count * sizeof(ListBlock)))
            continue;
        const List list = List::make(block_count);
        for (uint32_t b = 0; b < block_count; ++b) jobs.push_back({name, list.blocks() + b, b});
        slot.list = list;
        slot.last_used = frame_;
    }
    pool.forEach(jobs.size(), [&](size_t i, int) {
        const Job& job = jobs[i];
        makePoints(job.name, job.block * kBlockPoints, kBlockPoints, *job.out);
    });
}

bool PointLists::takeBudget(size_t bytes) {
    if (bytes_.fetch_add(bytes) + bytes + visible_bytes_ <= budget_) return true;
    bytes_ -= bytes;
    is_full_.store(true, std::memory_order_relaxed);
    return false;
}

namespace {

// A point before it is quantized, in the space of its node.
struct Point {
    Vec3 position = Vec3(0);
    DVec3 normal = DVec3(0);   // geometric; length: the density it deserves over that of its list
    bool is_textured = false;  // looked up by `at`, else:
    Vec3 shading_normal = Vec3(0), albedo = Vec3(0);  // of the node's space
    MeshPoint at;
    float patch_width = 0.0f;
    bool single_sided = false;
    uint8_t alpha = 255;
    uint16_t material = 0;
    uint32_t instance = 0;
    uint8_t levels = 1;
};

template <class T>
Point makeMeshPoint(const Scene& scene, const Mesh& mesh, const std::vector<T>& cumulative_area,
                    const MeshNode& node, double position, const PointKey& key, bool layers) {
    const MeshPoint at = meshPointAt(cumulative_area, node, position, key);
    const UVec3& t = mesh.triangles[at.triangle];
    const Vec3 a = mesh.positions[t.x], e1 = mesh.positions[t.y] - a, e2 = mesh.positions[t.z] - a;
    const Stratum& stratum = mesh.strata[mesh.triangle_stratum[at.triangle]];
    Point p;
    p.position = a + e1 * at.u + e2 * at.v;
    p.at = at;
    p.patch_width = stratum.patch_width;
    p.single_sided = !stratum.double_sided;
    p.material = mesh.triangle_material[at.triangle];
    const Material& material = scene.materials[p.material];
    p.is_textured = material.isTextured();
    if (!p.is_textured) {
        const MeshSurface surface =
            surfaceAt(mesh, scene.materials, scene.textures, at.triangle, at.u, at.v, {});
        p.shading_normal = surface.normal_object;
        p.albedo = surface.albedo;
    }
    bool is_there = true;
    if (material.alpha_mode != AlphaMode::kOpaque) {
        const float alpha = alphaAt(mesh, scene.materials, scene.textures, at.triangle, at.u, at.v);
        if (material.alpha_mode == AlphaMode::kMask) {
            is_there = alpha >= material.alpha_cutoff;
        } else if (layers) {
            p.alpha = uint8_t(std::clamp(alpha, 0.0f, 1.0f) * 255.0f + 0.5f);
            is_there = p.alpha > 0;
        } else {
            is_there = uniformFloat(hashCombine(key.list, key.index, 3)) < alpha;
        }
    }
    if (is_there) p.normal = glm::normalize(glm::cross(DVec3(e1), DVec3(e2)));
    return p;
}

// Places on a triangle that are tried for one that a mask lets stand.
constexpr uint64_t kMaskAttempts = 8;

// Surface of groups within groups is looked at from so far that a point stands for its patch: its
// colour there, whatever texture it has.
void prefilter(const Scene& scene, const Mesh& mesh, Point& p) {
    if (!p.is_textured) return;
    LookupBeam beam;
    beam.diameter = p.patch_width;
    beam.direction = Vec3(p.normal);
    const MeshSurface surface =
        surfaceAt(mesh, scene.materials, scene.textures, p.at.triangle, p.at.u, p.at.v, beam);
    p.shading_normal = surface.normal_object;
    p.albedo = surface.albedo;
    p.is_textured = false;
}

// Positions known no better than to this share of what they run along are not random there.
constexpr double kCoarsePosition = 1.0 / 16;

Point makeGroupPoint(const Scene& scene, const Group& outermost, uint32_t node, const PointKey& key,
                     bool layers) {
    const Group* group = &outermost;
    InstancePoint at = instanceAt(scene, *group, node, listPosition(key));
    ChildRef child = group->instances.child(at.instance);
    Affine group_from_mesh = group->instances.groupFromChild(at.instance);
    // Sums go by the product of what each level's transform does to areas at most.
    double area_scale = group->instances.areaScale(at.instance);
    uint64_t path = extendObjectPath(0, group->listed_index[at.instance]);
    int levels = 1;
    // Each level uses up digits of the position: where none are left, more are drawn.
    double resolution = positionResolution(key.sampler) / std::max(at.share, 1e-12);
    for (; child.isGroup(); ++levels) {
        group = &scene.groups[child.index()];
        if (resolution > kCoarsePosition) {
            at.position = uniformDouble(hashCombine(key.list, key.index, uint64_t(levels), 8));
            resolution = positionResolution(Sampler::kRandom);
        }
        at = instanceAt(scene, *group, 0, at.position);
        resolution /= std::max(at.share, 1e-12);
        child = group->instances.child(at.instance);
        group_from_mesh = group_from_mesh * group->instances.groupFromChild(at.instance);
        area_scale *= group->instances.areaScale(at.instance);
        path = extendObjectPath(path, group->listed_index[at.instance]);
    }
    if (resolution > kCoarsePosition && levels > 1)
        at.position = uniformDouble(hashCombine(key.list, key.index, uint64_t(levels), 8));
    area_scale = std::max(area_scale, 1e-30);
    const Mesh& mesh = scene.meshes[child.index()];
    const float length_scale = float(std::sqrt(area_scale));
    Point p =
        makeMeshPoint(scene, mesh, mesh.cumulative_area, mesh.nodes[0], at.position, key, layers);
    if (outermost.depth > 1) prefilter(scene, mesh, p);
    // Drawn for the largest area scale of the transform; this orientation's may be smaller.
    DMat3 area_map = cofactor(group_from_mesh.linear);
    area_map *= (glm::dot(group_from_mesh.linear[0], area_map[0]) < 0.0 ? -1.0 : 1.0) / area_scale;
    p.position = Vec3(group_from_mesh.point(DVec3(p.position)));
    p.normal = area_map * p.normal;
    const DVec3 shading = area_map * DVec3(p.shading_normal);
    p.shading_normal = Vec3(shading / std::max(glm::length(shading), 1e-30));
    p.patch_width *= length_scale;
    p.instance = outermost.depth > 1 ? uint32_t(path) : at.instance;
    p.levels = uint8_t(std::min(levels, 255));
    return p;
}

// An alpha mask may say that there is nothing.
bool isThere(const Point& p) { return p.normal != DVec3(0.0); }

void writePoint(const Point& p, const Box3& box, int lane, ListBlock& out) {
    const Vec3 extent = box.extent();
    for (int axis = 0; axis < 3; ++axis) {
        const float q =
            extent[axis] > 0.0f ? (p.position[axis] - box.min[axis]) / extent[axis] : 0.0f;
        out.position[axis][lane] = uint16_t(std::clamp(q, 0.0f, 1.0f) * 65535.0f + 0.5f);
        out.normal[axis][lane] = int16_t(std::lround(p.normal[axis] * 32767.0));
    }
    out.width[lane] = isThere(p) ? patchWidthCode(p.patch_width, kFirstMetreExponent) : kNoPatch;
    out.single_sided[lane] = p.single_sided;
    out.alpha[lane] = p.alpha;
    out.normal_or_triangle[lane] = p.is_textured ? p.at.triangle : packOctahedral(p.shading_normal);
    out.albedo_or_place[lane] = p.is_textured ? packPlace({p.at.u, p.at.v}) : packSrgb8(p.albedo);
    out.material[lane] = p.material;
    out.instance[lane] = p.instance;
    out.levels[lane] = p.levels;
}

}  // namespace

void PointLists::makePoints(const ListName& name, uint32_t first, int count, ListBlock& out) {
    const Box3& box = nodeBounds(scene_, name.child, name.node);
    const bool layers = identity_.layers;
    const bool is_whole = name.direction == ListName::kWhole;
    PointKey key{identity_.sampler, hashCombine(identity_.seed, name.child.bits, name.node), first};
    if (!is_whole) key.list = hashCombine(key.list, uint64_t(name.direction), 6);
    const auto makeAll = [&](const auto& make) {
        for (int lane = 0; lane < count; ++lane, ++key.index) writePoint(make(), box, lane, out);
    };
    if (name.child.isGroup()) {
        const Group& group = scene_.groups[name.child.index()];
        makeAll([&] { return makeGroupPoint(scene_, group, name.node, key, layers); });
        return;
    }
    const Mesh& mesh = scene_.meshes[name.child.index()];
    const MeshNode& node = mesh.nodes[name.node];
    const auto makeOn = [&](const auto& cumulative_area) {
        makeAll([&] {
            return makeMeshPoint(scene_, mesh, cumulative_area, node, listPosition(key), key,
                                 layers);
        });
    };
    if (is_whole) {
        makeOn(mesh.cumulative_area);
        return;
    }
    const VisibleArea& visible = visibleArea(name.child.index(), name.direction);
    makeAll([&] {
        Point p;
        // What was seen of a masked triangle is surface.
        for (uint64_t attempt = 0; attempt < kMaskAttempts && !isThere(p); ++attempt) {
            PointKey k = key;
            if (attempt > 0) k.list = hashCombine(key.list, attempt);
            p = makeMeshPoint(scene_, mesh, visible.cumulative, node, listPosition(key), k, layers);
        }
        p.patch_width = visible.patch_width;
        return p;
    });
}

PointLists::List PointLists::grow(Slot& slot, const ListName& name, uint32_t n_blocks) {
    const std::lock_guard lock(stripes_[(name.child.bits * 31 + name.node) % kStripes]);
    const List old = slot.list.load(std::memory_order_acquire);
    const uint32_t have = old.blockCount();
    if (have >= n_blocks) return old;
    const uint32_t capacity = std::bit_ceil(n_blocks);
    if (!takeBudget(capacity * sizeof(ListBlock))) return List();
    const List list = List::make(capacity);
    std::copy_n(old.blocks(), have, list.blocks());
    for (uint32_t b = have; b < capacity; ++b)
        makePoints(name, b * kBlockPoints, kBlockPoints, list.blocks()[b]);
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
    makePoints(name, first, count, scratch);
    first_lane = 0;
    return scratch;
}

}  // namespace stipple
