// SPDX-License-Identifier: Apache-2.0
// The points of a mesh node: an endless sequence, each point a pure function of (seed, mesh, node,
// index), and a cache of the sequences' beginnings. With the stratified sampler every prefix is
// well spread over the node's area: the index, bit-reversed, runs along the distribution list,
// whose triangles are in Morton order. Based on: Wand et al. 2001 ("Precomputation: Distribution
// List", "Sample caching"); van der Corput sequence; Basu, Owen. Low discrepancy constructions in
// the triangle. 2015 (the remainder steers a 4-way subdivision of the triangle).
#pragma once

#include <core/points.h>
#include <scenegraph/scene.h>

#include <atomic>
#include <memory>
#include <mutex>

namespace stipple {

// Stratum of a point that lies where an alpha mask says there is no surface.
inline constexpr uint8_t kNoSurface = 15;

// 64 points, quantized to the node's box: 23 bytes each, those that drawing reads first.
struct ListBlock {
    alignas(64) uint16_t position[3][kBlockPoints];  // box.min + box.extent * q / 65535
    int16_t normal[3][kBlockPoints];                 // geometric, unit * 32767
    uint8_t stratum[kBlockPoints];                   // index into Mesh::strata, or kNoSurface
    uint32_t shading_normal[kBlockPoints];           // octahedral, 2 x 16 bits
    uint32_t albedo[kBlockPoints];                   // sRGB-encoded, 8 bits a channel
    uint16_t material[kBlockPoints];
};

uint32_t packOctahedral(const Vec3& unit);
Vec3 unpackOctahedral(uint32_t packed);
uint32_t packSrgb8(const Vec3& linear);
Vec3 unpackSrgb8(uint32_t packed);

// Where on a mesh a point lies.
struct MeshPoint {
    uint32_t triangle = 0;
    float u = 0.0f, v = 0.0f;
};

// Point `index` of a node's sequence, uniform over the node's area.
MeshPoint drawMeshPoint(const Mesh& mesh, const MeshNode& node, Sampler sampler, uint64_t key,
                        uint32_t index);

// Names the sequences: everything their points depend on.
struct ListIdentity {
    uint64_t seed = 1;
    Sampler sampler = Sampler::kStratified;
    bool operator==(const ListIdentity&) const = default;
};

class PointLists {
public:
    explicit PointLists(const Scene& scene);
    ~PointLists();

    // Call between frames: sets the identity (a new one empties the cache) and the budget; above
    // it, lists that were not used in the last frame are dropped.
    void startFrame(const ListIdentity& identity, size_t budget_bytes);
    // Points [first, first + count) of a node's sequence, which must not cross a multiple of 64:
    // lanes [first_lane, first_lane + count) of the block returned. From the cache, which first
    // grows to `list_length` points if the budget allows, else made in `scratch`. The same bits
    // either way. Thread-safe.
    const ListBlock& points(uint32_t mesh, uint32_t node, uint32_t first, int count,
                            uint32_t list_length, ListBlock& scratch, int& first_lane);
    size_t bytes() const { return bytes_.load(std::memory_order_relaxed); }

private:
    struct List;
    struct Slot {
        std::atomic<List*> list{nullptr};
        std::atomic<uint32_t> last_used{0};
    };

    void makePoints(uint32_t mesh, uint32_t node, uint32_t first, int count, ListBlock& out) const;
    List* grow(Slot& slot, uint32_t mesh, uint32_t node, uint32_t n_blocks);
    void clear();

    const Scene& scene_;
    std::vector<std::unique_ptr<Slot[]>> slots_;  // [mesh][node]
    ListIdentity identity_;
    size_t budget_ = 0;
    std::atomic<size_t> bytes_{0};
    uint32_t frame_ = 0;
    std::mutex mutex_;  // guards retired_
    std::vector<std::unique_ptr<List>> retired_;
    static constexpr int kStripes = 64;
    std::mutex stripes_[kStripes];  // one list grows at a time in each stripe
};

}  // namespace stipple
