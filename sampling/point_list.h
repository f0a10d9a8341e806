// SPDX-License-Identifier: Apache-2.0
// The points of a node of a mesh, or of a group that is instanced often: an endless sequence, each
// point a pure function of (seed, mesh or group, node, index), and a cache of the sequences'
// beginnings. With the stratified sampler every prefix is well spread over the node's area: the
// index, bit-reversed, runs along the distribution list, whose triangles are in Morton order. Based
// on: Wand et al. 2001 ("Sample caching").
#pragma once

#include <core/parallel.h>
#include <core/points.h>
#include <sampling/list_point.h>
#include <scenegraph/scene_editor.h>
#include <scenegraph/visible_area.h>

#include <atomic>
#include <map>
#include <memory>
#include <mutex>

namespace stipple {

// Patch widths of list points are codes of metres from 2^this.
inline constexpr int kFirstMetreExponent = -14;

// 64 points, quantized to the node's box: 14 bytes each that drawing reads, then what is looked up.
struct ListBlock {
    alignas(64) uint16_t position[3][kBlockPoints];  // box.min + box.extent * q / 65535
    int16_t normal[3][kBlockPoints];                 // geometric, times 32767 x the density that it
                                                     // deserves over that of the list; 0 where an
                                                     // alpha mask says there is no surface
    uint8_t width[kBlockPoints];                     // patchWidthCode(), in metres
    uint8_t single_sided[kBlockPoints];              // 1: not seen from behind
    uint8_t alpha[kBlockPoints];  // of blended surfaces that are drawn in layers, below 255; 255
                                  // elsewhere
    // Of materials without textures: the shading normal (octahedral, 2 x 16 bits) and the albedo
    // (sRGB-encoded, 8 bits a channel). Of others the triangle and the place on it (packPlace()):
    // what is seen there depends on how far away it is.
    uint32_t normal_or_triangle[kBlockPoints];
    uint32_t albedo_or_place[kBlockPoints];
    uint16_t material[kBlockPoints];
    // In lists of groups: the instance of the group's InstanceStore or, where groups lie within,
    // the low half of the object path from there on, so many levels deep; the point is prefiltered
    // then.
    uint32_t instance[kBlockPoints];
    uint8_t levels[kBlockPoints];
};

uint32_t packOctahedral(const Vec3& unit);
Vec3 unpackOctahedral(uint32_t packed);
// Barycentrics, 16 bits each.
uint32_t packPlace(Vec2 uv);
Vec2 unpackPlace(uint32_t packed);

// Lists grow up to here; points beyond are made anew each time.
inline constexpr uint32_t kLongestList = 4096;

// Names the sequences: everything their points depend on.
struct ListIdentity {
    uint64_t seed = 1;
    Sampler sampler = Sampler::kStratified;
    bool layers = false;  // blended surfaces have all their points, each with its alpha
    bool operator==(const ListIdentity&) const = default;
};

// A sequence of points: on the whole surface below a node, or, for the root of a mesh, on what can
// be seen of it from one of the directions of visible_area.h.
struct ListName {
    static constexpr int kWhole = -1;
    ChildRef child;
    uint32_t node = 0;
    int direction = kWhole;
};

class PointLists {
public:
    explicit PointLists(const Scene& scene);
    ~PointLists();

    // Meshes have lists, and groups with many instances of their own: one list serves all.
    bool hasLists(ChildRef child) const {
        return !slotsOf(child).empty() && !(child.isGroup() && is_stale_[child.index()]);
    }
    // Call between frames: drops the lists of nodes that have changed, keeps the others.
    // O(what has changed + groups).
    void sceneChanged(const SceneChanges& changes);
    const ListIdentity& identity() const { return identity_; }
    // Call between frames: sets the identity (a new one empties the cache) and the budget. Where
    // it did not suffice, lists that were not used in the last frame are dropped; where it has
    // become smaller than what is there, all are. Lists that the last frame used and edits have
    // dropped are made anew, by all threads.
    void startFrame(const ListIdentity& identity, size_t budget_bytes, ThreadPool& pool);
    // What can be seen of a mesh from a direction; measured when first asked for, then kept for the
    // frame at least, and beyond it within the budget. Thread-safe.
    const VisibleArea& visibleArea(uint32_t mesh, int direction);
    // How much of the points on the whole of a group makes it cover what it should: of its meshes
    // the mean, by area (VisibleArea::whole_factor); kept like visibleArea(). Thread-safe.
    const SpacingTable& wholeFactor(uint32_t group);
    // Points [first, first + count) of a sequence, which must not cross a multiple of 64:
    // lanes [first_lane, first_lane + count) of the block returned. From the cache, which first
    // grows to `list_length` points if the budget allows, else made in `scratch`. The same bits
    // either way. Thread-safe.
    const ListBlock& points(const ListName& name, uint32_t first, int count, uint32_t list_length,
                            ListBlock& scratch, int& first_lane);
    size_t bytes() const { return bytes_ + visible_bytes_; }

private:
    // The blocks of a list and how many there are, a power of two, in one word: who draws them
    // waits for memory once less. A null list has none.
    class List {
    public:
        List() = default;
        static List make(uint32_t block_count);
        void destroy() { delete[] blocks(); }
        bool isNull() const { return bits_ == 0; }
        ListBlock* blocks() const { return reinterpret_cast<ListBlock*>(bits_ & ~kCountBits); }
        uint32_t blockCount() const { return isNull() ? 0 : 1u << (bits_ & kCountBits); }

    private:
        static constexpr uintptr_t kCountBits = alignof(ListBlock) - 1;
        uintptr_t bits_ = 0;
    };
    struct Slot {
        std::atomic<List> list{List()};
        std::atomic<uint32_t> last_used{0};
    };
    using Slots = std::vector<Slot>;  // one a node
    // A mesh from one direction.
    struct Seen {
        VisibleArea area;
        Slot slot;  // of the root
        std::atomic<uint32_t> last_used{0};

        size_t bytes() const { return area.cumulative.size() * sizeof(float); }
    };

    const Slots& slotsOf(ChildRef child) const {
        return (child.isGroup() ? group_slots_ : mesh_slots_)[child.index()];
    }
    Slot& slotOf(const ListName& name);
    Seen& seen(uint32_t mesh, int direction);
    void drop(Slot& slot);
    void freeRetired();
    void dropEdited(const ListName& name);
    void dropGroup(uint32_t group);
    void remakeDropped(ThreadPool& pool);
    template <class Visit>
    void forEachSlot(const Visit& visit);
    void makePoints(const ListName& name, uint32_t first, int count, ListBlock& out);
    void findStale();
    const SpacingTable& factorOf(ChildRef child);
    SpacingTable makeFactor(ChildRef child);
    bool takeBudget(size_t bytes);
    List grow(Slot& slot, const ListName& name, uint32_t n_blocks);

    const Scene& scene_;
    std::vector<Slots> mesh_slots_, group_slots_;
    // Groups that lie below an edit which the sums around do not know yet: their lists would be
    // wrong.
    std::vector<bool> is_stale_;
    std::vector<std::atomic<Seen*>> seen_;  // by mesh and direction
    // Made when needed, meshes' and groups' by ChildRef::bits; lookups go by factor_of_.
    std::map<uint32_t, SpacingTable> factors_;
    std::vector<std::atomic<const SpacingTable*>> factor_of_;  // by group
    std::mutex factor_mutex_;
    std::vector<bool> is_deep_;  // groups that hold groups: their lists' points are prefiltered
    // Of groups, by edits since the last frame, which used them; with the blocks they had.
    struct Dropped {
        ListName name;
        uint32_t block_count;
    };
    std::vector<Dropped> dropped_;
    ListIdentity identity_;
    size_t budget_ = 0;
    std::atomic<size_t> bytes_{0}, visible_bytes_{0};
    std::atomic<bool> is_full_{false};  // a list was refused in this frame
    uint32_t frame_ = 0;
    std::mutex mutex_;  // guards retired_
    std::vector<List> retired_;
    size_t retired_bytes_ = 0;
    static constexpr int kStripes = 64;
    std::mutex stripes_[kStripes];  // one list grows at a time in each stripe
    std::mutex seen_stripes_[kStripes];
};

}  // namespace stipple
