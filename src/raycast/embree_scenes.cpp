// SPDX-License-Identifier: Apache-2.0
#include <raycast/embree_scenes.h>

#include <core/error.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr size_t kMaxParts = 32;
constexpr size_t kInstanceBytes =
    256;  // of an instance geometry, measured: Embree's monitor does not report them

struct ReleaseGeometry {
    void operator()(RTCGeometry g) const { rtcReleaseGeometry(g); }
};
using GeometryHandle = std::unique_ptr<RTCGeometryTy, ReleaseGeometry>;

GeometryHandle newGeometry(const EmbreeDevice& device, RTCGeometryType type) {
    GeometryHandle geometry(rtcNewGeometry(device.get(), type));
    if (!geometry) device.check();
    return geometry;
}

// A hit may turn out to be none: alpha, or the back of a single-sided surface.
bool needsFilter(const Material& m) {
    return m.alpha_mode != AlphaMode::kOpaque || !m.double_sided;
}

// Runs of triangles that need the filter and that do not. The strata sort triangles so, which
// leaves few runs; a mesh with many is filtered as a whole.
std::vector<uint32_t> filterRuns(const Scene& scene, const Mesh& mesh, bool& first_filtered) {
    const auto filtered = [&](size_t t) {
        return needsFilter(scene.materials[mesh.triangle_material[t]]);
    };
    std::vector<uint32_t> begins{0};
    first_filtered = filtered(0);
    for (size_t t = 1; t < mesh.triangles.size(); ++t) {
        if (filtered(t) == filtered(t - 1)) continue;
        if (begins.size() == kMaxParts) {
            first_filtered = true;
            return {0};
        }
        begins.push_back(uint32_t(t));
    }
    return begins;
}

// Shares the mesh's positions where reading 16 bytes at the last one stays within what the vector
// owns, as Embree does.
void setVertices(RTCGeometry geometry, const Mesh& mesh) {
    const size_t n = mesh.positions.size();
    if (mesh.positions.capacity() > n) {
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                   mesh.positions.data(), 0, sizeof(Vec3), n);
        return;
    }
    void* copy = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                         sizeof(Vec3), n);
    if (copy) std::copy(mesh.positions.begin(), mesh.positions.end(), static_cast<Vec3*>(copy));
}

void groupInstanceBounds(const RTCBoundsFunctionArguments* args) {
    const GroupScene& group = *static_cast<const GroupScene*>(args->geometryUserPtr);
    const auto [part, slot] = group.groupAt(args->primID);
    const Group& child = group.scenes->scene->groups[part->group->instances.child(slot).index()];
    RTCBounds& b = *args->bounds_o;
    if (child.bounds.isEmpty()) {  // Embree leaves out primitives with inverted bounds
        b = {kInfinity, kInfinity, kInfinity, 0, -kInfinity, -kInfinity, -kInfinity, 0};
        return;
    }
    const Box3 box = enclosingFloatBox(transformBox(part->sceneFromChild(slot), child.bounds));
    // Rays are rounded when they enter the child; what touches its box must not be lost.
    const Vec3 pad = glm::max(glm::abs(box.min), glm::abs(box.max)) * 1e-6f;
    b = {box.min.x - pad.x, box.min.y - pad.y, box.min.z - pad.z, 0,
         box.max.x + pad.x, box.max.y + pad.y, box.max.z + pad.z, 0};
}

[[noreturn]] void throwTooDeep(const std::string& path) {
    throw Error(ErrorCode::kUnsupported, path,
                "groups are nested deeper than " + std::to_string(kMaxNesting) + " levels");
}

// How often every group is placed within what the root shows.
void countPlacements(const Scene& scene, uint32_t index, std::vector<uint32_t>& placed) {
    if (placed[index]++ > 0) return;  // what is below has been counted
    const InstanceStore& instances = scene.groups[index].instances;
    for (size_t slot = 0; slot < instances.size(); ++slot) {
        const ChildRef child = instances.child(slot);
        if (child.isGroup()) countPlacements(scene, child.index(), placed);
    }
}

// The part whose ids, from part.*first on, hold id.
PartSlot findSlot(const std::vector<ScenePart>& parts, uint32_t ScenePart::*first,
                  const std::vector<uint32_t> ScenePart::*slots, uint32_t id) {
    const auto next =
        std::upper_bound(parts.begin(), parts.end(), id,
                         [&](uint32_t i, const ScenePart& part) { return i < part.*first; });
    const ScenePart& part = *(next - 1);
    const uint32_t i = id - part.*first;
    return {&part, (part.*slots).empty() ? i : (part.*slots)[i]};
}

}  // namespace

PartSlot GroupScene::meshAt(uint32_t geometry_id) const {
    return findSlot(parts, &ScenePart::first_mesh, &ScenePart::mesh_slots, geometry_id);
}
PartSlot GroupScene::groupAt(uint32_t primitive_id) const {
    return findSlot(parts, &ScenePart::first_group, &ScenePart::group_slots, primitive_id);
}

EmbreeDevice::EmbreeDevice(int n_threads)
    : device_(rtcNewDevice(n_threads > 0 ? ("threads=" + std::to_string(n_threads)).c_str()
                                         : nullptr)) {
    if (!device_) {
        throw Error(ErrorCode::kInternal, "Embree",
                    "no device (error " + std::to_string(int(rtcGetDeviceError(nullptr))) + ")");
    }
    rtcSetDeviceErrorFunction(device_.get(), onError, this);
    rtcSetDeviceMemoryMonitorFunction(device_.get(), onMemory, this);
}

void EmbreeDevice::check() const {
    const std::lock_guard lock(mutex_);
    if (error_ == RTC_ERROR_NONE) return;
    throw Error(error_ == RTC_ERROR_OUT_OF_MEMORY ? ErrorCode::kOutOfMemory : ErrorCode::kInternal,
                "Embree", message_);
}

void EmbreeDevice::onError(void* self, RTCError code, const char* message) {
    EmbreeDevice& device = *static_cast<EmbreeDevice*>(self);
    const std::lock_guard lock(device.mutex_);
    if (device.error_ != RTC_ERROR_NONE) return;
    device.error_ = code;
    device.message_ = message ? message : "error " + std::to_string(int(code));
}

bool EmbreeDevice::onMemory(void* self, ssize_t bytes, bool) {
    static_cast<EmbreeDevice*>(self)->bytes_ += bytes;
    return true;
}

EmbreeScenes::EmbreeScenes(const Scene& s, const DVec3& origin_world, int n_threads,
                           const TraceCallbacks& callbacks)
    : scene(&s),
      device(n_threads),
      meshes(s.meshes.size()),
      groups(s.groups.size()),
      pool_(n_threads),
      callbacks_(callbacks),
      origin_world_(origin_world),
      placed_(s.groups.size()) {
    if (s.root >= s.groups.size())
        throw Error(ErrorCode::kInvalidScene, s.path, "the scene has no root group");
    countPlacements(s, s.root, placed_);
    buildGroup(s.root, 1);
}

SceneHandle EmbreeScenes::newScene() {
    SceneHandle handle(rtcNewScene(device.get()));
    device.check();
    rtcSetSceneBuildQuality(handle.get(), RTC_BUILD_QUALITY_HIGH);
    return handle;
}

void EmbreeScenes::buildMesh(uint32_t index) {
    MeshScene& out = meshes[index];
    if (out.handle) return;
    const Mesh& mesh = scene->meshes[index];
    out.handle = newScene();
    bool filtered = false;
    const std::vector<uint32_t> begins =
        mesh.triangles.empty() ? std::vector<uint32_t>() : filterRuns(*scene, mesh, filtered);
    for (uint32_t begin : begins) out.parts.push_back({scene, &mesh, begin});
    for (size_t i = 0; i < begins.size(); ++i, filtered = !filtered) {
        const size_t end = i + 1 < begins.size() ? begins[i + 1] : mesh.triangles.size();
        const GeometryHandle geometry = newGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        setVertices(geometry.get(), mesh);
        rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                   mesh.triangles.data(), begins[i] * sizeof(UVec3), sizeof(UVec3),
                                   end - begins[i]);
        rtcSetGeometryBuildQuality(geometry.get(), RTC_BUILD_QUALITY_HIGH);
        rtcSetGeometryUserData(geometry.get(), &out.parts[i]);
        if (filtered) {
            rtcSetGeometryIntersectFilterFunction(geometry.get(), callbacks_.filter_hit);
            rtcSetGeometryOccludedFilterFunction(geometry.get(), callbacks_.filter_hit);
        }
        rtcCommitGeometry(geometry.get());
        rtcAttachGeometryByID(out.handle.get(), geometry.get(), uint32_t(i));
    }
    rtcCommitScene(out.handle.get());
    device.check();
}

// An instance geometry for every mesh of the group, by all threads: Embree has no faster way to
// make many.
void EmbreeScenes::addInstances(const GroupScene& out) {
    constexpr uint32_t kChunk = 4096;
    pool_.forEach((out.n_meshes + kChunk - 1) / kChunk, [&](size_t chunk, int) {
        const uint32_t begin = uint32_t(chunk) * kChunk;
        for (uint32_t id = begin; id < std::min(begin + kChunk, out.n_meshes); ++id) {
            const auto [part, slot] = out.meshAt(id);
            const Affine a = part->sceneFromChild(slot);
            float columns[12];
            for (int c = 0; c < 4; ++c) {
                for (int r = 0; r < 3; ++r)
                    columns[3 * c + r] = float(c < 3 ? a.linear[c][r] : a.translation[r]);
            }
            const GeometryHandle geometry = newGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
            rtcSetGeometryInstancedScene(
                geometry.get(), meshes[part->group->instances.child(slot).index()].handle.get());
            rtcSetGeometryTransform(geometry.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
            rtcCommitGeometry(geometry.get());
            rtcAttachGeometryByID(out.handle.get(), geometry.get(), id);
        }
    });
}

// Adds a group's instances to a scene, and in its place those of a group that is placed only here.
void EmbreeScenes::addPart(GroupScene& out, uint32_t index, const Affine& scene_from_group,
                           const std::vector<uint32_t>& path, int level) {
    if (level > kMaxNesting) throwTooDeep(scene->path);
    out.height = std::max(out.height, 1 + int(path.size()));
    const InstanceStore& instances = scene->groups[index].instances;
    const uint32_t n = uint32_t(instances.size());
    ScenePart part;
    part.group = &scene->groups[index];
    part.scene_from_group = scene_from_group;
    part.path = path;
    part.first_mesh = out.n_meshes;
    part.first_group = out.n_groups;
    std::vector<uint32_t> dissolved;
    uint32_t n_meshes = 0, n_groups = 0;
    for (uint32_t slot = 0; slot < n; ++slot) {
        const ChildRef child = instances.child(slot);
        if (child.isNone()) continue;
        if (!child.isGroup()) {
            buildMesh(child.index());
            ++n_meshes;
        } else if (placed_[child.index()] == 1) {
            dissolved.push_back(slot);
        } else {
            buildGroup(child.index(), level + 1);
            out.height = std::max(out.height, 1 + int(path.size()) + groups[child.index()].height);
            ++n_groups;
        }
    }
    if (n_meshes < n && n_groups < n) {
        part.mesh_slots.reserve(n_meshes);
        part.group_slots.reserve(n_groups);
        for (uint32_t slot = 0; slot < n; ++slot) {
            const ChildRef child = instances.child(slot);
            if (child.isNone()) continue;
            if (!child.isGroup()) {
                part.mesh_slots.push_back(slot);
            } else if (placed_[child.index()] > 1) {
                part.group_slots.push_back(slot);
            }
        }
    }
    out.n_meshes += n_meshes;
    out.n_groups += n_groups;
    out.parts.push_back(std::move(part));
    for (const uint32_t slot : dissolved) {
        std::vector<uint32_t> child_path = path;
        child_path.push_back(slot);
        addPart(out, instances.child(slot).index(),
                scene_from_group * instances.groupFromChild(slot), child_path, level + 1);
    }
}

void EmbreeScenes::buildGroup(uint32_t index, int level) {
    GroupScene& out = groups[index];
    if (out.handle) {
        if (level + out.height - 1 > kMaxNesting) throwTooDeep(scene->path);
        return;
    }
    out.scenes = this;
    Affine scene_from_group;
    if (index == scene->root) scene_from_group.translation = -origin_world_;
    addPart(out, index, scene_from_group, {}, level);
    out.handle = newScene();
    addInstances(out);
    if (out.n_groups > 0) {
        const GeometryHandle geometry = newGeometry(device, RTC_GEOMETRY_TYPE_USER);
        rtcSetGeometryUserPrimitiveCount(geometry.get(), out.n_groups);
        rtcSetGeometryUserData(geometry.get(), &out);
        rtcSetGeometryBoundsFunction(geometry.get(), groupInstanceBounds, nullptr);
        rtcSetGeometryIntersectFunction(geometry.get(), callbacks_.intersect_group);
        rtcSetGeometryOccludedFunction(geometry.get(), callbacks_.occlude_group);
        rtcCommitGeometry(geometry.get());
        rtcAttachGeometryByID(out.handle.get(), geometry.get(), out.n_meshes);
    }
    rtcCommitScene(out.handle.get());
    device.check();
}

size_t EmbreeScenes::bytes() const {
    size_t bytes =
        device.bytes() + meshes.size() * sizeof(MeshScene) + groups.size() * sizeof(GroupScene);
    for (const MeshScene& m : meshes) bytes += m.parts.size() * sizeof(MeshPart);
    for (const GroupScene& g : groups) {
        bytes += g.n_meshes * kInstanceBytes;
        for (const ScenePart& p : g.parts) {
            bytes +=
                sizeof(ScenePart) +
                (p.path.size() + p.mesh_slots.size() + p.group_slots.size()) * sizeof(uint32_t);
        }
    }
    return bytes;
}

}  // namespace stipple
