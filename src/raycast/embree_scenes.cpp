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
    const uint32_t slot = group.groupSlot(args->primID);
    const Group& child = group.scenes->scene->groups[group.group->instances.child(slot).index()];
    RTCBounds& b = *args->bounds_o;
    if (child.bounds.isEmpty()) {  // Embree leaves out primitives with inverted bounds
        b = {kInfinity, kInfinity, kInfinity, 0, -kInfinity, -kInfinity, -kInfinity, 0};
        return;
    }
    const Box3 box = enclosingFloatBox(transformBox(group.groupFromChild(slot), child.bounds));
    // Rays are rounded when they enter the child; what touches its box must not be lost.
    const Vec3 pad = glm::max(glm::abs(box.min), glm::abs(box.max)) * 1e-6f;
    b = {box.min.x - pad.x, box.min.y - pad.y, box.min.z - pad.z, 0,
         box.max.x + pad.x, box.max.y + pad.y, box.max.z + pad.z, 0};
}

}  // namespace

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
      callbacks_(callbacks),
      origin_world_(origin_world) {
    if (s.root >= s.groups.size())
        throw Error(ErrorCode::kInvalidScene, s.path, "the scene has no root group");
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
        if (filtered) rtcSetGeometryIntersectFilterFunction(geometry.get(), callbacks_.filter_hit);
        rtcCommitGeometry(geometry.get());
        rtcAttachGeometryByID(out.handle.get(), geometry.get(), uint32_t(i));
    }
    rtcCommitScene(out.handle.get());
    device.check();
}

void EmbreeScenes::addInstance(GroupScene& out, uint32_t slot) {
    const Affine a = out.groupFromChild(slot);
    float columns[12];
    for (int c = 0; c < 4; ++c) {
        for (int r = 0; r < 3; ++r)
            columns[3 * c + r] = float(c < 3 ? a.linear[c][r] : a.translation[r]);
    }
    const GeometryHandle geometry = newGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry.get(),
                                 meshes[out.group->instances.child(slot).index()].handle.get());
    rtcSetGeometryTransform(geometry.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
    rtcCommitGeometry(geometry.get());
    rtcAttachGeometry(out.handle.get(), geometry.get());
}

void EmbreeScenes::buildGroup(uint32_t index, int level) {
    GroupScene& out = groups[index];
    if (out.handle) return;
    const auto checkDepth = [&](int height) {
        if (level + height > kMaxNesting) {
            throw Error(ErrorCode::kUnsupported, scene->path,
                        "groups are nested deeper than " + std::to_string(kMaxNesting) + " levels");
        }
    };
    checkDepth(0);
    out.group = &scene->groups[index];
    out.scenes = this;
    if (index == scene->root) out.origin = origin_world_;
    const InstanceStore& instances = out.group->instances;
    const uint32_t n = uint32_t(instances.size());
    uint32_t n_groups = 0;
    int child_height = 0;
    for (uint32_t slot = 0; slot < n; ++slot) {
        const ChildRef child = instances.child(slot);
        if (child.isGroup()) {
            ++n_groups;
            buildGroup(child.index(), level + 1);
            child_height = std::max(child_height, groups[child.index()].height);
        } else {
            buildMesh(child.index());
        }
    }
    checkDepth(child_height);
    out.height = 1 + child_height;
    out.has_groups = n_groups > 0;
    out.n_meshes = n - n_groups;
    if (out.has_groups && out.n_meshes > 0) {
        out.group_slots.reserve(n_groups);
        out.mesh_slots.reserve(out.n_meshes);
        for (uint32_t slot = 0; slot < n; ++slot) {
            (instances.child(slot).isGroup() ? out.group_slots : out.mesh_slots).push_back(slot);
        }
    }
    out.handle = newScene();
    for (uint32_t id = 0; id < out.n_meshes; ++id)
        addInstance(out, out.meshSlot(id));  // their geometry ids count from 0
    if (out.has_groups) {
        const GeometryHandle geometry = newGeometry(device, RTC_GEOMETRY_TYPE_USER);
        rtcSetGeometryUserPrimitiveCount(geometry.get(), n_groups);
        rtcSetGeometryUserData(geometry.get(), &out);
        rtcSetGeometryBoundsFunction(geometry.get(), groupInstanceBounds, nullptr);
        rtcSetGeometryIntersectFunction(geometry.get(), callbacks_.intersect_group);
        rtcCommitGeometry(geometry.get());
        rtcAttachGeometry(out.handle.get(), geometry.get());
    }
    rtcCommitScene(out.handle.get());
    device.check();
}

size_t EmbreeScenes::bytes() const {
    size_t bytes =
        device.bytes() + meshes.size() * sizeof(MeshScene) + groups.size() * sizeof(GroupScene);
    for (const MeshScene& m : meshes) bytes += m.parts.size() * sizeof(MeshPart);
    for (const GroupScene& g : groups) {
        bytes += (g.mesh_slots.size() + g.group_slots.size()) * sizeof(uint32_t) +
                 g.n_meshes * kInstanceBytes;
    }
    return bytes;
}

}  // namespace stipple
