// SPDX-License-Identifier: Apache-2.0
// Tracing and hit attributes. A scene without nested groups is traced in packets where rays are
// coherent; elsewhere rays go one by one, and the user geometry's callback carries them into the
// instanced group.
#include <raycast/embree_raycaster.h>

#include <core/rng.h>
#include <raycast/embree_scenes.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

#include <array>
#include <bit>

namespace stipple {

namespace {

constexpr size_t kPacket = 16;
constexpr int kAllActive = -1;
constexpr int kFewChanges = 5;  // of the instance from ray to ray within a packet; measured

// Where a ray ended: the slots from the root down to the mesh, and the place on it.
struct HitPlace {
    int depth = 0;  // slots used
    std::array<uint32_t, kMaxNesting> slots;
    uint32_t geometry_id = 0;
    uint32_t primitive_id = 0;
    float u = 0.0f, v = 0.0f;
};

// What one call of Embree is about. Embree hands its address (as that of the context) to the
// callbacks.
struct Level {
    RTCIntersectContext embree;         // first, so that the addresses are the same
    const GroupScene* group = nullptr;  // the one traced
    const Level* parent = nullptr;      // the level from which the ray came here ...
    PartSlot from;                      // ... and through which of its instances
    int depth = 0;                      // slots from the root to the group
    bool is_from_end = false;           // surfaces are looked at from the rays' far ends
    // The ray in double, in the group's space: rounding errors must not add up on the way down.
    // Nested scenes only.
    DVec3 origin = DVec3(0.0);
    DVec3 direction = DVec3(0.0);
    const Ray* rays = nullptr;       // by the ray's id: as the caller gave them
    HitPlace* nested_hit = nullptr;  // nearest hit below any group instance
};

Level makeLevel(const GroupScene& group, RTCIntersectContextFlags flags) {
    Level level;
    rtcInitIntersectContext(&level.embree);
    level.embree.flags = flags;
    level.group = &group;
    return level;
}

// Whether a blended surface is there for this ray: a pure function of the ray and the place.
bool isThere(float alpha, const Ray& ray, const Level& level, uint32_t instance_id,
             uint32_t triangle) {
    const auto bits = [](float f) { return uint64_t(std::bit_cast<uint32_t>(f)); };
    uint64_t key = hashCombine(bits(ray.origin.x), bits(ray.origin.y), bits(ray.origin.z),
                               bits(ray.direction.x), bits(ray.direction.y), bits(ray.direction.z));
    for (const Level* l = &level; l->parent; l = l->parent) key = hashCombine(key, l->from.slot);
    return uniformFloat(hashCombine(key, instance_id, triangle)) < alpha;
}

// Refuses candidate hits on what is not there. Ray and hit are in the mesh's space.
void filterHit(const RTCFilterFunctionNArguments* args) {
    const MeshPart& part = *static_cast<const MeshPart*>(args->geometryUserPtr);
    const Level& level = *reinterpret_cast<const Level*>(args->context);
    const Scene& scene = *part.scene;
    for (unsigned i = 0; i < args->N; ++i) {
        if (args->valid[i] != kAllActive) continue;
        const uint32_t triangle = part.first_triangle + RTCHitN_primID(args->hit, args->N, i);
        const Material& material = scene.materials[part.mesh->triangle_material[triangle]];
        if (!material.double_sided) {
            const Vec3 direction(RTCRayN_dir_x(args->ray, args->N, i),
                                 RTCRayN_dir_y(args->ray, args->N, i),
                                 RTCRayN_dir_z(args->ray, args->N, i));
            const Vec3 normal(RTCHitN_Ng_x(args->hit, args->N, i),
                              RTCHitN_Ng_y(args->hit, args->N, i),
                              RTCHitN_Ng_z(args->hit, args->N, i));
            const float away = glm::dot(direction, normal);
            if (level.is_from_end ? away < 0.0f : away > 0.0f) {
                args->valid[i] = 0;
                continue;
            }
        }
        if (material.alpha_mode == AlphaMode::kOpaque) continue;
        const float alpha =
            alphaAt(*part.mesh, scene.materials, scene.textures, triangle,
                    RTCHitN_u(args->hit, args->N, i), RTCHitN_v(args->hit, args->N, i));
        const bool there = material.alpha_mode == AlphaMode::kMask
                               ? alpha >= material.alpha_cutoff
                               : isThere(alpha, level.rays[RTCRayN_id(args->ray, args->N, i)],
                                         level, RTCHitN_instID(args->hit, args->N, i, 0), triangle);
        if (!there) args->valid[i] = 0;
    }
}

RTCRay makeRay(const Vec3& origin, const Vec3& direction, float t_min, float t_max, uint32_t id) {
    return {origin.x,    origin.y, origin.z, t_min, direction.x, direction.y,
            direction.z, 0.0f,     t_max,    ~0u,   id,          0};
}

RTCRayHit makeRayHit(const Vec3& origin, const Vec3& direction, float t_min, float t_max,
                     uint32_t id) {
    RTCRayHit r;
    r.ray = makeRay(origin, direction, t_min, t_max, id);
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    return r;
}

// A hit without an instance came out of the user geometry, which has stored its place.
bool isNested(const RTCHit& hit) { return hit.instID[0] == RTC_INVALID_GEOMETRY_ID; }

// The place of a hit on a mesh of the level's own group.
HitPlace placeOf(const Level& level, uint32_t instance_id, uint32_t geometry_id,
                 uint32_t primitive_id, float u, float v) {
    HitPlace place;
    int end = level.depth;
    const auto prepend = [&](const PartSlot& at) {
        place.slots[--end] = at.slot;
        end -= int(at.part->path.size());
        std::copy(at.part->path.begin(), at.part->path.end(), place.slots.begin() + end);
    };
    const PartSlot mesh = level.group->meshAt(instance_id);
    place.depth = end += mesh.part->depth();
    prepend(mesh);
    for (const Level* l = &level; l->parent; l = l->parent) prepend(l->from);
    place.geometry_id = geometry_id;
    place.primitive_id = primitive_id;
    place.u = u;
    place.v = v;
    return place;
}

// The level of a group instance that a ray of the level above meets. t means the same there: the
// direction is transformed, not normalized.
Level makeInnerLevel(const GroupScene& parent, const Level& outer, uint32_t primitive_id) {
    const PartSlot at = parent.groupAt(primitive_id);
    const GroupScene& child =
        parent.scenes->groups[at.part->group->instances.child(at.slot).index()];
    const Affine child_from_parent = inverse(at.part->sceneFromChild(at.slot));
    Level level = makeLevel(child, outer.embree.flags);
    level.parent = &outer;
    level.from = at;
    level.depth = outer.depth + at.part->depth();
    level.is_from_end = outer.is_from_end;
    level.origin = child_from_parent.point(outer.origin);
    level.direction = child_from_parent.linear * outer.direction;
    level.rays = outer.rays;
    level.nested_hit = outer.nested_hit;
    return level;
}

// Carries a ray into a group instance.
void intersectGroup(const RTCIntersectFunctionNArguments* args) {
    if (args->valid[0] != kAllActive)
        return;  // N is 1: scenes with nested groups are not traced in packets
    const GroupScene& parent = *static_cast<const GroupScene*>(args->geometryUserPtr);
    const Level& outer_level = *reinterpret_cast<const Level*>(args->context);
    RTCRayHit& outer = *reinterpret_cast<RTCRayHit*>(args->rayhit);
    Level level = makeInnerLevel(parent, outer_level, args->primID);
    RTCRayHit inner = makeRayHit(Vec3(level.origin), Vec3(level.direction), outer.ray.tnear,
                                 outer.ray.tfar, outer.ray.id);
    rtcIntersect1(level.group->handle.get(), &level.embree, &inner);
    if (inner.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
    if (!isNested(inner.hit)) {
        *level.nested_hit = placeOf(level, inner.hit.instID[0], inner.hit.geomID, inner.hit.primID,
                                    inner.hit.u, inner.hit.v);
    }
    outer.ray.tfar = inner.ray.tfar;
    outer.hit = inner.hit;
    outer.hit.geomID = args->geomID;
    outer.hit.primID = args->primID;
    outer.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
}

// The same for a ray of which only matters whether it is stopped.
void occludeGroup(const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] != kAllActive) return;  // N is 1
    const GroupScene& parent = *static_cast<const GroupScene*>(args->geometryUserPtr);
    const Level& outer_level = *reinterpret_cast<const Level*>(args->context);
    RTCRay& outer = *reinterpret_cast<RTCRay*>(args->ray);
    Level level = makeInnerLevel(parent, outer_level, args->primID);
    RTCRay inner =
        makeRay(Vec3(level.origin), Vec3(level.direction), outer.tnear, outer.tfar, outer.id);
    rtcOccluded1(level.group->handle.get(), &level.embree, &inner);
    if (inner.tfar < 0.0f) outer.tfar = -kInfinity;
}

bool isTraceable(const Ray& ray) {
    return isFinite(DVec3(ray.origin)) && isFinite(DVec3(ray.direction)) && ray.t_min >= 0.0f;
}

void setRay(RTCRay16& r, unsigned i, const Ray& ray) {
    r.org_x[i] = ray.origin.x;
    r.org_y[i] = ray.origin.y;
    r.org_z[i] = ray.origin.z;
    r.tnear[i] = ray.t_min;
    r.dir_x[i] = ray.direction.x;
    r.dir_y[i] = ray.direction.y;
    r.dir_z[i] = ray.direction.z;
    r.time[i] = 0.0f;
    r.tfar[i] = ray.t_max;
    r.mask[i] = ~0u;
    r.id[i] = i;
    r.flags[i] = 0;
}

// Packets pay where rays go through the same nodes.
bool areCoherent(const Ray* rays, size_t count) {
    const Vec3& first = rays[0].direction;
    const float length2 = glm::dot(first, first);
    for (size_t i = 1; i < count; ++i) {
        const Vec3& d = rays[i].direction;
        const float along = glm::dot(first, d);
        if (!(along > 0.0f && along * along > 0.99f * length2 * glm::dot(d, d))) return false;
    }
    return true;
}

class EmbreeRayCaster : public RayCaster {
public:
    EmbreeRayCaster(const Scene& scene, const DVec3& origin_world, int n_threads)
        : scenes_(scene, origin_world, n_threads,
                  TraceCallbacks{filterHit, intersectGroup, occludeGroup}) {}

    void cast(const Ray* rays, size_t count, RayHit* hits, float footprint_per_t) const override {
        const bool packets = scenes_.root().n_groups == 0;
        // Whether packets stay together: as the packet before, which lies next to it.
        bool together = true;
        for (size_t begin = 0; begin < count; begin += kPacket) {
            const size_t n = std::min(kPacket, count - begin);
            if (packets && n == kPacket && areCoherent(rays + begin, n)) {
                together = castPacket(rays + begin, hits + begin, footprint_per_t, together);
            } else {
                for (size_t i = begin; i < begin + n; ++i)
                    castOne(rays[i], hits[i], footprint_per_t);
            }
        }
    }

    void occluded(const Ray* rays, size_t count, uint8_t* is_hit) const override {
        const bool packets = scenes_.root().n_groups == 0;
        for (size_t begin = 0; begin < count; begin += kPacket) {
            const size_t n = std::min(kPacket, count - begin);
            if (packets && n == kPacket) {
                occludedPacket(rays + begin, is_hit + begin);
            } else {
                for (size_t i = begin; i < begin + n; ++i) is_hit[i] = occludedOne(rays[i]);
            }
        }
    }

    size_t bytes() const override { return scenes_.bytes(); }

private:
    uint8_t occludedOne(const Ray& ray) const {
        if (!isTraceable(ray)) return 0;
        Level level = makeLevel(scenes_.root(), RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
        level.is_from_end = true;
        level.origin = DVec3(ray.origin);
        level.direction = DVec3(ray.direction);
        level.rays = &ray;
        RTCRay r = makeRay(ray.origin, ray.direction, ray.t_min, ray.t_max, 0);
        rtcOccluded1(scenes_.root().handle.get(), &level.embree, &r);
        return r.tfar < 0.0f;
    }

    // Rays to one light begin apart in foliage: Embree takes them one by one, but in one call.
    void occludedPacket(const Ray* rays, uint8_t* is_hit) const {
        RTCRay16 r;
        alignas(64) int valid[kPacket];
        for (unsigned i = 0; i < kPacket; ++i) {
            valid[i] = isTraceable(rays[i]) ? kAllActive : 0;
            setRay(r, i, rays[i]);
        }
        Level level = makeLevel(scenes_.root(), RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
        level.is_from_end = true;
        level.rays = rays;
        rtcOccluded16(valid, scenes_.root().handle.get(), &level.embree, &r);
        for (unsigned i = 0; i < kPacket; ++i) is_hit[i] = valid[i] && r.tfar[i] < 0.0f;
    }

    void castOne(const Ray& ray, RayHit& hit, float footprint_per_t) const {
        hit = RayHit();
        if (!isTraceable(ray)) return;
        HitPlace place;
        Level level = makeLevel(scenes_.root(), RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
        level.origin = DVec3(ray.origin);
        level.direction = DVec3(ray.direction);
        level.rays = &ray;
        level.nested_hit = &place;
        RTCRayHit r = makeRayHit(ray.origin, ray.direction, ray.t_min, ray.t_max, 0);
        rtcIntersect1(scenes_.root().handle.get(), &level.embree, &r);
        if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
        if (!isNested(r.hit))
            place = placeOf(level, r.hit.instID[0], r.hit.geomID, r.hit.primID, r.hit.u, r.hit.v);
        hit = attributesAt(place, ray, r.ray.tfar, footprint_per_t);
    }

    // together: the packet is traversed as one rather than ray by ray. Returns whether its rays
    // ended on few instances: then the next packet's will go the same ways, too.
    bool castPacket(const Ray* rays, RayHit* hits, float footprint_per_t, bool together) const {
        RTCRayHit16 r;
        alignas(64) int valid[kPacket];
        for (unsigned i = 0; i < kPacket; ++i) {
            valid[i] = isTraceable(rays[i]) ? kAllActive : 0;
            setRay(r.ray, i, rays[i]);
            r.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
            r.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
        Level level = makeLevel(scenes_.root(), together ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                         : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
        level.rays = rays;
        rtcIntersect16(valid, scenes_.root().handle.get(), &level.embree, &r);
        int changes = 0;
        for (size_t i = 0; i < kPacket; ++i) {
            changes += i > 0 && r.hit.instID[0][i] != r.hit.instID[0][i - 1];
            hits[i] = RayHit();
            if (r.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
            hits[i] = attributesAt(placeOf(level, r.hit.instID[0][i], r.hit.geomID[i],
                                           r.hit.primID[i], r.hit.u[i], r.hit.v[i]),
                                   rays[i], r.ray.tfar[i], footprint_per_t);
        }
        return changes <= kFewChanges;
    }

    RayHit attributesAt(const HitPlace& place, const Ray& ray, float t,
                        float footprint_per_t) const {
        const Scene& scene = *scenes_.scene;
        DMat3 world_from_object(1.0);
        uint64_t path = 0;
        ChildRef child = ChildRef::group(scene.root);
        for (int i = 0; i < place.depth; ++i) {
            const Group& group = scene.groups[child.index()];
            const uint32_t slot = place.slots[i];
            world_from_object = world_from_object * group.instances.groupFromChild(slot).linear;
            path = extendObjectPath(path,
                                    group.listed_index.empty() ? slot : group.listed_index[slot]);
            child = group.instances.child(slot);
        }
        const MeshPart& part = scenes_.meshes[child.index()].parts[place.geometry_id];
        const uint32_t triangle = part.first_triangle + place.primitive_id;

        const uint32_t material = part.mesh->triangle_material[triangle];

        // The cofactor matrix is the inverse transpose times the determinant: area vectors grow by
        // it.
        const DMat3 area_scale = cofactor(world_from_object);
        const double side = glm::determinant(world_from_object) < 0.0 ? -1.0 : 1.0;
        LookupBeam beam;
        if (scene.materials[material].isTextured()) {
            const UVec3& v = part.mesh->triangles[triangle];
            const DVec3 a(part.mesh->positions[v.x]), b(part.mesh->positions[v.y]),
                c(part.mesh->positions[v.z]);
            const DVec3 area_object = glm::cross(b - a, c - a);
            const double length_scale =
                std::sqrt(glm::length(area_scale * area_object) / glm::length(area_object));
            if (length_scale > 0.0) beam.diameter = float(footprint_per_t * t / length_scale);
            // Scaled to length 1 or so before floats take it.
            const DVec3 direction = glm::transpose(area_scale) * DVec3(ray.direction);
            beam.direction = Vec3(direction / std::max(glm::length(direction), 1e-300));
        }
        const MeshSurface surface = surfaceAt(*part.mesh, scene.materials, scene.textures, triangle,
                                              place.u, place.v, beam);

        RayHit hit;
        hit.t = t;
        hit.normal_world = Vec3(glm::normalize(area_scale * DVec3(surface.normal_object) * side));
        hit.albedo = surface.albedo;
        hit.finish = surface.finish;
        hit.material = material;
        hit.object = objectId(path);
        return hit;
    }

    EmbreeScenes scenes_;
};

}  // namespace

std::unique_ptr<RayCaster> makeEmbreeRayCaster(const Scene& scene, const DVec3& origin_world,
                                               int n_threads) {
    return std::make_unique<EmbreeRayCaster>(scene, origin_world, n_threads);
}

}  // namespace stipple
