// SPDX-License-Identifier: Apache-2.0
// The points of a node of a mesh, or of a group that is instanced often: an endless sequence
// (list_block.h), and a cache of the sequences' beginnings. With the stratified sampler every
// prefix is well spread over the area of a mesh's node: the index, bit-reversed, runs along the
// distribution list, whose triangles are in Morton order. In groups it is spread well over a node's
// children, and less so over theirs. Based on: Wand et al. 2001 ("Sample caching").
#pragma once

#include <core/parallel.h>
#include <sampling/list_block.h>

#include <atomic>
#include <map>
#include <memory>
#include <mutex>

namespace stipple {

// Lists grow up to here; points beyond are made anew each time.
inline constexpr uint32_t kLongestList = 4096;

class PointLists {
public:
    explicit PointLists(const Scene& scene);
    ~PointLists();

    // Meshes have lists, and groups with many instances of their own: one list serves all.
    bool hasLists(ChildRef child) const {
        return !slotsOf(child).empty() && !(child.isGroup() && is_stale_[child.index()]);
    }
    // Call between frames: puts the lists of nodes that have changed aside, keeps the others.
    // O(what has changed + groups).
    void sceneChanged(const SceneChanges& changes);
    const ListIdentity& identity() const { return identity_; }
    // Call between frames: sets the identity (a new one empties the cache) and the budget. Where
    // it did not suffice, lists that were not used in the last frame are dropped; where it has
    // become smaller than what is there, all are. Lists that the last frame used and edits have
    // changed are brought up to date, by all threads.
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
    void putAside(const ListName& name, bool is_whole);
    void putGroupAside(uint32_t group);
    void dropOutdated();
    void updateOutdated(ThreadPool& pool);
    void updateNames();
    template <class Visit>
    void forEachSlot(const Visit& visit);
    ListSource sourceOf(const ListName& name);
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
    // Lists of groups that the last frame used, which edits have changed since.
    struct Outdated {
        ListName name;
        List list;
        bool is_whole = false;  // no point of it is still right
    };
    std::vector<Outdated> outdated_;
    GroupEdits edits_;
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
