// SPDX-License-Identifier: Apache-2.0
#include <sampling/point_list.h>

#include <core/image.h>
#include <core/rng.h>
#include <scenegraph/surface_at.h>

#include <array>
#include <cstring>

namespace stipple {

namespace {

const std::array<float, 256>& srgbTable() {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> t;
        for (int i = 0; i < 256; ++i) t[i] = linearFromSrgb(float(i) / 255.0f);
        return t;
    }();
    return table;
}

uint32_t to8(float linear) {
    return uint32_t(srgbFromLinear(std::clamp(linear, 0.0f, 1.0f)) * 255.0f + 0.5f);
}

}  // namespace

uint32_t packOctahedral(const Vec3& n) {
    const float s = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    Vec2 p = s > 0.0f ? Vec2(n.x, n.y) / s : Vec2(0.0f);
    if (n.z < 0.0f) {
        p = Vec2((1.0f - std::abs(p.y)) * (p.x >= 0.0f ? 1.0f : -1.0f),
                 (1.0f - std::abs(p.x)) * (p.y >= 0.0f ? 1.0f : -1.0f));
    }
    const auto q = [](float v) { return uint32_t(std::lround((v * 0.5f + 0.5f) * 65535.0f)); };
    return q(p.x) | q(p.y) << 16;
}

Vec3 unpackOctahedral(uint32_t packed) {
    const float x = float(packed & 0xffff) * (2.0f / 65535.0f) - 1.0f;
    const float y = float(packed >> 16) * (2.0f / 65535.0f) - 1.0f;
    Vec3 n(x, y, 1.0f - std::abs(x) - std::abs(y));
    const float t = std::max(-n.z, 0.0f);
    n.x += n.x >= 0.0f ? -t : t;
    n.y += n.y >= 0.0f ? -t : t;
    return glm::normalize(n);
}

uint32_t packSrgb8(const Vec3& c) { return to8(c.x) | to8(c.y) << 8 | to8(c.z) << 16; }

Vec3 unpackSrgb8(uint32_t p) {
    const auto& table = srgbTable();
    return Vec3(table[p & 255], table[p >> 8 & 255], table[p >> 16 & 255]);
}

MeshPoint drawMeshPoint(const Mesh& mesh, const MeshNode& node, Sampler sampler, uint64_t key,
                        uint32_t index) {
    const double* cumulative = mesh.cumulative_area.data();
    const uint32_t first = node.first_triangle, count = node.triangle_count;
    const double begin = cumulative[first], area = cumulative[first + count] - begin;
    // Position along the list, in [0, 1): van der Corput with a random shift, or random.
    double t;
    if (sampler == Sampler::kRandom) {
        t = uniformDouble(hashCombine(key, index));
    } else {
        t = double(reverseBits(index)) * 0x1p-32 + uniformDouble(key);
        t -= std::floor(t);
    }
    const double target = begin + t * area;
    const double* found =
        std::upper_bound(cumulative + first + 1, cumulative + first + count, target);
    MeshPoint p;
    p.triangle = uint32_t(found - cumulative) - 1;
    const double triangle_area = cumulative[p.triangle + 1] - cumulative[p.triangle];
    double r = triangle_area > 0.0
                   ? std::clamp((target - cumulative[p.triangle]) / triangle_area, 0.0, 1.0)
                   : 0.0;
    if (sampler == Sampler::kRandom) {
        const float a = std::sqrt(float(r)), b = uniformFloat(hashCombine(key, index, 1));
        p.u = a * (1.0f - b), p.v = a * b;
        return p;
    }
    // Base-4 digits of the remainder choose one of four sub-triangles, coarse to fine.
    Vec2 a(0, 0), b(1, 0), c(0, 1);
    for (int digit = 0; digit < 8; ++digit) {
        r *= 4.0;
        const int d = std::min(int(r), 3);
        r -= d;
        const Vec2 ab = 0.5f * (a + b), bc = 0.5f * (b + c), ca = 0.5f * (c + a);
        switch (d) {
            case 0:
                a = bc, b = ca, c = ab;
                break;
            case 1:
                b = ab, c = ca;
                break;
            case 2:
                a = ab, c = bc;
                break;
            default:
                a = ca, b = bc;
                break;
        }
    }
    // What is left is placed at random within the last sub-triangle.
    const uint64_t h = hashCombine(key, index, 2);
    float s = uniformFloat(h), q = uniformFloat(mixBits(h));
    if (s + q > 1.0f) s = 1.0f - s, q = 1.0f - q;
    const Vec2 uv = a + (b - a) * s + (c - a) * q;
    p.u = uv.x, p.v = uv.y;
    return p;
}

struct PointLists::List {
    uint32_t block_count = 0;
    std::unique_ptr<ListBlock[]> blocks;
};

PointLists::PointLists(const Scene& scene) : scene_(scene) {
    for (const Mesh& mesh : scene.meshes)
        slots_.push_back(std::make_unique<Slot[]>(mesh.nodes.size()));
}

PointLists::~PointLists() { clear(); }

void PointLists::clear() {
    for (size_t m = 0; m < slots_.size(); ++m) {
        for (size_t n = 0; n < scene_.meshes[m].nodes.size(); ++n)
            delete slots_[m][n].list.exchange(nullptr);
    }
    retired_.clear();
    bytes_ = 0;
}

void PointLists::startFrame(const ListIdentity& identity, size_t budget_bytes) {
    retired_.clear();
    budget_ = budget_bytes;
    if (!(identity == identity_)) {
        clear();
        identity_ = identity;
    }
    if (bytes_ > budget_) {
        for (size_t m = 0; m < slots_.size(); ++m) {
            for (size_t n = 0; n < scene_.meshes[m].nodes.size(); ++n) {
                Slot& slot = slots_[m][n];
                List* list = slot.list.load();
                if (!list || (budget_ > 0 && slot.last_used.load() == frame_)) continue;
                bytes_ -= list->block_count * sizeof(ListBlock);
                delete slot.list.exchange(nullptr);
            }
        }
    }
    ++frame_;
}

void PointLists::makePoints(uint32_t mesh_index, uint32_t node_index, uint32_t first, int count,
                            ListBlock& out) const {
    const Mesh& mesh = scene_.meshes[mesh_index];
    const MeshNode& node = mesh.nodes[node_index];
    const uint64_t key = hashCombine(identity_.seed, mesh_index, node_index);
    const Vec3 extent = node.bounds.extent();
    // A point of a full list stands for this much of the surface; textures are filtered to it.
    const float footprint = float(std::sqrt(node.area / double(kBlockPoints * 16)));
    for (int lane = 0; lane < count; ++lane) {
        const uint32_t index = first + uint32_t(lane);
        const MeshPoint p = drawMeshPoint(mesh, node, identity_.sampler, key, index);
        const UVec3& t = mesh.triangles[p.triangle];
        const Vec3 a = mesh.positions[t.x], e1 = mesh.positions[t.y] - a,
                   e2 = mesh.positions[t.z] - a;
        const Vec3 position = a + e1 * p.u + e2 * p.v;
        const DVec3 n = glm::normalize(glm::cross(DVec3(e1), DVec3(e2)));
        for (int axis = 0; axis < 3; ++axis) {
            const float q = extent[axis] > 0.0f
                                ? (position[axis] - node.bounds.min[axis]) / extent[axis]
                                : 0.0f;
            out.position[axis][lane] = uint16_t(std::clamp(q, 0.0f, 1.0f) * 65535.0f + 0.5f);
            out.normal[axis][lane] = int16_t(std::lround(n[axis] * 32767.0));
        }
        const MeshSurface surface =
            surfaceAt(mesh, scene_.materials, scene_.textures, p.triangle, p.u, p.v, footprint);
        const uint16_t material_index = mesh.triangle_material[p.triangle];
        const Material& material = scene_.materials[material_index];
        const bool is_there = material.alpha_mode == AlphaMode::kOpaque ||
                              (material.alpha_mode == AlphaMode::kMask
                                   ? alphaAt(mesh, scene_.materials, scene_.textures, p.triangle,
                                             p.u, p.v) >= material.alpha_cutoff
                                   : uniformFloat(hashCombine(key, index, 3)) < surface.alpha);
        out.stratum[lane] = is_there ? mesh.triangle_stratum[p.triangle] : kNoSurface;
        out.shading_normal[lane] = packOctahedral(surface.normal_object);
        out.albedo[lane] = packSrgb8(surface.albedo);
        out.material[lane] = material_index;
    }
}

PointLists::List* PointLists::grow(Slot& slot, uint32_t mesh, uint32_t node, uint32_t n_blocks) {
    const std::lock_guard lock(stripes_[(mesh * 31 + node) % kStripes]);
    List* old = slot.list.load(std::memory_order_acquire);
    if (old && old->block_count >= n_blocks) return old;
    uint32_t capacity = 1;
    while (capacity < n_blocks) capacity *= 2;
    const size_t added = capacity * sizeof(ListBlock);
    if (bytes_.load(std::memory_order_relaxed) + added > budget_) return nullptr;
    bytes_ += added;
    auto list = std::make_unique<List>();
    list->block_count = capacity;
    list->blocks = std::make_unique_for_overwrite<ListBlock[]>(capacity);
    const uint32_t have = old ? old->block_count : 0;
    if (old) std::memcpy(list->blocks.get(), old->blocks.get(), have * sizeof(ListBlock));
    for (uint32_t b = have; b < capacity; ++b)
        makePoints(mesh, node, b * kBlockPoints, kBlockPoints, list->blocks[b]);
    List* result = list.release();
    slot.list.store(result, std::memory_order_release);
    if (old) {
        // Other threads may still read it; it goes when the frame is over.
        bytes_ -= have * sizeof(ListBlock);
        const std::lock_guard retired_lock(mutex_);
        retired_.emplace_back(old);
    }
    return result;
}

const ListBlock& PointLists::points(uint32_t mesh, uint32_t node, uint32_t first, int count,
                                    uint32_t list_length, ListBlock& scratch, int& first_lane) {
    const uint32_t block = first / kBlockPoints;
    if (budget_ > 0 && first < list_length) {
        Slot& slot = slots_[mesh][node];
        List* list = slot.list.load(std::memory_order_acquire);
        if (!list || list->block_count <= block) {
            list = grow(slot, mesh, node, (list_length + kBlockPoints - 1) / kBlockPoints);
        }
        if (list) {
            if (slot.last_used.load(std::memory_order_relaxed) != frame_) {
                slot.last_used.store(frame_, std::memory_order_relaxed);
            }
            first_lane = int(first % kBlockPoints);
            return list->blocks[block];
        }
    }
    makePoints(mesh, node, first, count, scratch);
    first_lane = 0;
    return scratch;
}

}  // namespace stipple
