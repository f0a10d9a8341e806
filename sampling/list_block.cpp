// SPDX-License-Identifier: Apache-2.0
#include <sampling/list_block.h>

#include <core/image.h>
#include <core/octahedral.h>
#include <core/rng.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

#include <algorithm>
#include <bit>
#include <cmath>

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
    uint8_t levels = 1, branch = 0;
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

// The instances on the way to a point of a group's list, from the group inwards: visit(group, place
// in its InstanceStore) each. Returns the branch at the list's node.
template <class Visit>
uint8_t visitInstances(const Scene& scene, uint32_t group_index, uint32_t node, WayNumbers& way,
                       const Visit& visit) {
    for (uint8_t branch = 0, level = 0;; level = 1, node = 0) {
        const Group& group = scene.groups[group_index];
        const ChosenInstance chosen = chooseInstance(scene, group, node, way);
        if (level == 0) branch = chosen.branch;
        visit(group_index, chosen.instance);
        const ChildRef child = group.instances.child(chosen.instance);
        if (!child.isGroup()) return branch;
        group_index = child.index();
    }
}

Point makeGroupPoint(const Scene& scene, uint32_t outermost, uint32_t node, const PointKey& key,
                     bool layers) {
    Affine group_from_mesh;
    // Sums go by the product of what each level's transform does to areas at most.
    double area_scale = 1.0;
    uint64_t path = 0;
    uint32_t instance = 0, mesh_index = 0;
    int levels = 0;
    WayNumbers way(key);
    const uint8_t branch = visitInstances(scene, outermost, node, way, [&](uint32_t g, uint32_t i) {
        const Group& group = scene.groups[g];
        if (levels++ == 0) instance = i;
        group_from_mesh = group_from_mesh * group.instances.groupFromChild(i);
        area_scale *= group.instances.areaScale(i);
        path = extendObjectPath(path, group.listed_index[i]);
        mesh_index = group.instances.child(i).index();
    });
    area_scale = std::max(area_scale, 1e-30);
    const Mesh& mesh = scene.meshes[mesh_index];
    const float length_scale = float(std::sqrt(area_scale));
    Point p =
        makeMeshPoint(scene, mesh, mesh.cumulative_area, mesh.nodes[0], way.next(), key, layers);
    const bool is_deep = scene.groups[outermost].depth > 1;
    if (is_deep) prefilter(scene, mesh, p);
    // Drawn for the largest area scale of the transform; this orientation's may be smaller.
    DMat3 area_map = cofactor(group_from_mesh.linear);
    area_map *= (glm::dot(group_from_mesh.linear[0], area_map[0]) < 0.0 ? -1.0 : 1.0) / area_scale;
    p.position = Vec3(group_from_mesh.point(DVec3(p.position)));
    p.normal = area_map * p.normal;
    const DVec3 shading = area_map * DVec3(p.shading_normal);
    p.shading_normal = Vec3(shading / std::max(glm::length(shading), 1e-30));
    p.patch_width *= length_scale;
    p.instance = is_deep ? uint32_t(path) : instance;
    p.levels = uint8_t(std::min(levels, 255));
    p.branch = branch;
    return p;
}

// An alpha mask may say that there is nothing.
bool isThere(const Point& p) { return p.normal != DVec3(0.0); }

void writePoint(const Point& p, int lane, ListBlock& out) {
    const Box3& box = out.box;
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
    out.branch[lane] = p.branch;
}

PointKey listKey(const ListSource& source, uint32_t first) {
    const ListName& name = source.name;
    const ListIdentity& identity = source.identity;
    PointKey key{identity.sampler, hashCombine(identity.seed, name.child.bits, name.node), first};
    if (name.direction != ListName::kWhole)
        key.list = hashCombine(key.list, uint64_t(name.direction), 6);
    return key;
}

// Outwards to multiples of the power of two that is larger than the extent.
void widen(float& low, float& high) {
    const float extent = high - low;
    if (!(extent > 1e-30f && extent < 1e30f)) return;
    constexpr uint32_t kOne = 0x3f800000, kExponent = 0x7f800000;
    const uint32_t step_bits = (std::bit_cast<uint32_t>(extent) & kExponent) + 0x00800000;
    const float step = std::bit_cast<float>(step_bits),
                inverse = std::bit_cast<float>(2 * kOne - step_bits);
    const float a = low * inverse, b = high * inverse;
    constexpr float kMostSteps = 1 << 20;  // beyond, floats do not tell them apart
    if (!(std::max(std::abs(a), std::abs(b)) < kMostSteps)) return;
    const int first = int(a), last = int(b);
    low = float(first - (float(first) > a)) * step;
    high = float(last + (float(last) < b)) * step;
}

}  // namespace

Box3 listBox(const Scene& scene, ChildRef child, uint32_t node) {
    Box3 box = nodeBounds(scene, child, node);
    if (!child.isGroup()) return box;
    for (int axis = 0; axis < 3; ++axis) widen(box.min[axis], box.max[axis]);
    return box;
}

void makeListPoints(const ListSource& source, uint32_t first, int count, ListBlock& out) {
    const auto& [scene, identity, name, visible] = source;
    const bool layers = identity.layers;
    PointKey key = listKey(source, first);
    out.box = listBox(scene, name.child, name.node);
    const auto makeAll = [&](const auto& make) {
        for (int lane = 0; lane < count; ++lane, ++key.index) writePoint(make(), lane, out);
    };
    if (name.child.isGroup()) {
        makeAll([&] { return makeGroupPoint(scene, name.child.index(), name.node, key, layers); });
        return;
    }
    const Mesh& mesh = scene.meshes[name.child.index()];
    const MeshNode& node = mesh.nodes[name.node];
    if (!visible) {
        makeAll([&] {
            return makeMeshPoint(scene, mesh, mesh.cumulative_area, node, listPosition(key), key,
                                 layers);
        });
        return;
    }
    makeAll([&] {
        Point p;
        // What was seen of a masked triangle is surface.
        for (uint64_t attempt = 0; attempt < kMaskAttempts && !isThere(p); ++attempt) {
            PointKey k = key;
            if (attempt > 0) k.list = hashCombine(key.list, attempt);
            p = makeMeshPoint(scene, mesh, visible->cumulative, node, listPosition(key), k, layers);
        }
        p.patch_width = visible->patch_width;
        return p;
    });
}

namespace {

// Residents make room for others.
uint32_t placeOfResident(const Group& group, const GroupNode& node, uint32_t listed,
                         uint32_t place_before) {
    if (place_before - node.first < node.resident_count &&
        group.listed_index[place_before] == listed)
        return place_before;
    const auto first = group.listed_index.begin() + node.first;
    return node.first + uint32_t(std::find(first, first + node.resident_count, listed) - first);
}

}  // namespace

void remakeListPoints(const ListSource& source, const GroupEdits& edits, uint32_t first,
                      ListBlock& block) {
    const auto& [scene, identity, name, visible] = source;
    const uint32_t group_index = name.child.index();
    const Group& group = scene.groups[group_index];
    const Box3 box = listBox(scene, name.child, name.node);
    if (!(box.min == block.box.min && box.max == block.box.max)) {
        makeListPoints(source, first, kBlockPoints, block);
        return;
    }
    const std::vector<uint32_t>& names = edits.names[group_index];
    const GroupNode& node = group.nodes[name.node];
    const Branches branches(scene, group, name.node);
    bool is_changed[std::size(branches.area)] = {};
    for (uint32_t c = 0; c < node.child_count; ++c)
        is_changed[c] = edits.nodes.contains({group_index, node.first_child + c});
    // Groups that reside there may have changed within.
    const bool is_deep = group.depth > 1;
    if (is_deep) std::fill_n(is_changed + Branches::kChildren, Branches::kKinds, true);
    for (auto i = edits.instances.lower_bound({group_index, 0});
         i != edits.instances.end() && i->first == group_index; ++i)
        is_changed[Branches::codeOfResident(i->second)] = true;
    PointKey key = listKey(source, first);
    for (int lane = 0; lane < kBlockPoints; ++lane, ++key.index) {
        uint32_t& instance = block.instance[lane];
        // Where nothing has changed, the same random numbers lead to the same point.
        const uint8_t at_node = branches.at(listPosition(key));
        if (at_node == block.branch[lane] && !is_changed[at_node]) {
            if (!Branches::isChild(at_node) && !is_deep)
                instance = placeOfResident(group, node, names[instance], instance);
            continue;
        }
        bool is_edited = false;
        uint64_t path = 0;
        uint32_t place = 0;
        int levels = 0;
        WayNumbers way(key);
        visitInstances(scene, group_index, name.node, way, [&](uint32_t g, uint32_t i) {
            const uint32_t listed = scene.groups[g].listed_index[i];
            is_edited |= edits.instances.contains({g, listed});
            path = extendObjectPath(path, listed);
            if (levels++ == 0) place = i;
        });
        const uint64_t path_before = is_deep ? instance : extendObjectPath(0, names[instance]);
        if (is_edited || levels != block.levels[lane] || uint32_t(path) != uint32_t(path_before)) {
            writePoint(makeGroupPoint(scene, group_index, name.node, key, identity.layers), lane,
                       block);
            continue;
        }
        block.branch[lane] = at_node;
        if (!is_deep) instance = place;
    }
}

}  // namespace stipple
