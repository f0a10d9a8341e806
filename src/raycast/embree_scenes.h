// SPDX-License-Identifier: Apache-2.0
// A scene graph as Embree scenes, one a mesh and one a group, never expanded: what
// embree_raycaster.cpp traces. Private to this folder.
#pragma once

#include <core/parallel.h>
#include <scenegraph/scene.h>

#include <embree3/rtcore.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace stipple {

// Every level of user geometry takes stack while a ray is traced.
inline constexpr int kMaxNesting = 64;

// Embree's handles, released with their owner.
struct ReleaseDevice {
    void operator()(RTCDevice d) const { rtcReleaseDevice(d); }
};
struct ReleaseScene {
    void operator()(RTCScene s) const { rtcReleaseScene(s); }
};
using DeviceHandle = std::unique_ptr<RTCDeviceTy, ReleaseDevice>;
using SceneHandle = std::unique_ptr<RTCSceneTy, ReleaseScene>;

// The device, what it reported and what it allocated. Embree calls back with its address: it stays
// where it is.
class EmbreeDevice {
public:
    // Throws kInternal. n_threads: for building (0: one a core).
    explicit EmbreeDevice(int n_threads);

    RTCDevice get() const { return device_.get(); }
    size_t bytes() const { return size_t(std::max<int64_t>(bytes_, 0)); }
    // Throws what Embree reported since the device was made: kOutOfMemory or kInternal.
    void check() const;

private:
    static void onError(void* self, RTCError code, const char* message);
    static bool onMemory(void* self, ssize_t bytes, bool after);

    std::atomic<int64_t> bytes_{0};
    mutable std::mutex mutex_;
    RTCError error_ = RTC_ERROR_NONE;  // the first one
    std::string message_;
    DeviceHandle device_;
};

// A geometry of a mesh's scene: the triangles from first_triangle on, which need the hit filter or
// do not.
struct MeshPart {
    const Scene* scene = nullptr;
    const Mesh* mesh = nullptr;
    uint32_t first_triangle = 0;
};

struct MeshScene {
    SceneHandle handle;
    std::vector<MeshPart> parts;  // by geometry id; not resized once Embree has their addresses
};

struct EmbreeScenes;

// What a group's scene shows of one group: its own instances, or those of a group below that is
// placed only once and was dissolved into it.
struct ScenePart {
    const Group* group = nullptr;
    Affine scene_from_group;     // relative to the eye for the root's scene
    std::vector<uint32_t> path;  // slots from the scene's group down to this one
    uint32_t first_mesh = 0;     // the first one's geometry id
    uint32_t first_group = 0;    // and primitive id of the user geometry
    // Its instances of meshes and of groups, in the order of these ids. Empty: all instances.
    std::vector<uint32_t> mesh_slots;
    std::vector<uint32_t> group_slots;

    int depth() const { return int(path.size()) + 1; }  // slots down to an instance of it
    Affine sceneFromChild(uint32_t slot) const {
        return scene_from_group * group->instances.groupFromChild(slot);
    }
};

struct PartSlot {
    const ScenePart* part = nullptr;
    uint32_t slot = 0;  // in the part's group
};

// A group's scene: meshes are Embree instances, as Embree has one level of them; groups are the
// primitives of one user geometry.
struct GroupScene {
    SceneHandle handle;
    const EmbreeScenes* scenes = nullptr;
    std::vector<ScenePart> parts;  // by ids, ascending
    uint32_t n_meshes = 0;         // instances of meshes
    uint32_t n_groups = 0;         // instances of groups
    int height = 0;                // levels of groups from here down

    PartSlot meshAt(uint32_t geometry_id) const;
    PartSlot groupAt(uint32_t primitive_id) const;
};

// What the tracer adds: called for every candidate hit of parts that need it, and for every group
// instance a ray meets.
struct TraceCallbacks {
    RTCFilterFunctionN filter_hit = nullptr;          // geometry user data: MeshPart
    RTCIntersectFunctionN intersect_group = nullptr;  // geometry user data: GroupScene
    RTCOccludedFunctionN occlude_group = nullptr;     // the same
};

struct EmbreeScenes {
    const Scene* scene = nullptr;
    EmbreeDevice device;
    std::vector<MeshScene> meshes;  // both as in Scene; without a handle where the root shows none
    std::vector<GroupScene> groups;

    // Builds what the root shows, children before parents. Groups placed only once are dissolved:
    // their instances cost the same in the group above, and rays need no further level. Throws
    // kOutOfMemory, kUnsupported (nested deeper than kMaxNesting), kInternal.
    EmbreeScenes(const Scene& scene, const DVec3& origin_world, int n_threads,
                 const TraceCallbacks& callbacks);

    const GroupScene& root() const { return groups[scene->root]; }
    size_t bytes() const;

private:
    void buildMesh(uint32_t index);
    void buildGroup(uint32_t index, int level);
    void addPart(GroupScene& out, uint32_t index, const Affine& scene_from_group,
                 const std::vector<uint32_t>& path, int level);
    SceneHandle newScene();
    void addInstances(const GroupScene& out);

    ThreadPool pool_;
    TraceCallbacks callbacks_;
    DVec3 origin_world_;
    std::vector<uint32_t> placed_;  // by group: how often, in all groups that the root shows
};

}  // namespace stipple
