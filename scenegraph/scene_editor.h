// SPDX-License-Identifier: Apache-2.0
// Edits of a built scene: instances come, go and move, and the sums along their path to the root
// follow at once. Based on: Wand et al. 2001 ("Dynamic Distribution Lists": insertion and removal
// in O(height of the octree)).
#pragma once

#include <scenegraph/scene.h>

#include <map>
#include <memory>
#include <vector>

namespace stipple {

// An instance: the group that holds it and the instance's Group::listed_index there.
struct InstanceId {
    uint32_t group = 0;
    uint32_t index = 0;
    bool operator==(const InstanceId&) const = default;
};

// What has changed since it was last asked for; caches follow.
struct SceneChanges {
    struct Node {
        uint32_t group = 0, node = 0;
    };
    std::vector<Node> nodes;            // of groups: the instances below are others, or elsewhere
    std::vector<InstanceId> instances;  // came, went, moved, or show something else
    bool all_nodes = false;             // too many nodes or instances to tell
    // Groups that have changed, and all that hold them.
    std::vector<uint32_t> groups;
    // Of these, those in which any node may show something else.
    std::vector<uint32_t> whole_groups;
    // Groups with sums that do not know the areas of what they hold (Group::as_child), old changes
    // included.
    std::vector<uint32_t> stale_groups;
    // In the world: what has come, gone or moved lies within; or it may be anywhere.
    std::vector<DBox3> boxes;
    bool anywhere = false;
    bool assets = false;  // meshes have come
    bool any = false;
};

// One at a time for a scene, and no frame at the same time. What is undone leaves the same octree
// behind: the same residents in the same order, so the same picture, unless it became too deep in
// between. A group that is instanced many times
// changes everywhere at once; ownGroup() makes a copy for one place. Indices that are not there, or
// not any more, singular transforms and groups that would contain themselves throw
// kInvalidArgument; then nothing has changed.
class SceneEditor {
public:
    // O(stored instances), once.
    explicit SceneEditor(Scene& scene);

    // O(log n), inserts and moves on average: a part of the octree that has become too deep is made
    // anew. O(n) for the first edit of a group. A group's bounds grow in the groups that
    // instance it: O(log n) for each of the places, up to kFewUses of them; beyond, O(groups) for
    // their slack, until that is a quarter of the group's size, its area has doubled or halved, or
    // its largest triangle has grown: then O(n) of the groups that instance it.
    InstanceId insert(uint32_t group, ChildRef child, const Affine& group_from_child);
    void remove(InstanceId id);
    void move(InstanceId id, const Affine& group_from_child);
    void replace(InstanceId id, ChildRef child);
    // A removed instance again, under its name.
    void restore(InstanceId id, ChildRef child, const Affine& group_from_child);

    struct NewInstance {
        ChildRef child;
        Affine group_from_child;
    };
    // As many inserts, the group's octree built anew where that is less work: O(n log n). Their
    // names are consecutive; the first is returned.
    InstanceId insertMany(uint32_t group, const std::vector<NewInstance>& instances,
                          ThreadPool& pool);

    // Throws what replace() and move() would.
    void check(InstanceId id, ChildRef child, const Affine& group_from_child);

    bool contains(InstanceId id);
    ChildRef child(InstanceId id);
    Affine groupFromChild(InstanceId id);

    // Names along the path from the root's instance down.
    InstanceId find(const std::vector<uint32_t>& path);
    // The same, but groups along the path that are instanced elsewhere are copied for this place:
    // what is changed there changes nowhere else. O(instances of those groups).
    InstanceId findOwn(const std::vector<uint32_t>& path);

    // Takes over meshes, groups, materials and textures of a built scene, and makes its `child`
    // known by a name that is new. description: what saveScene() writes, JSON. O(what comes).
    ChildRef addAsset(const std::string& name, Scene asset, ChildRef child,
                      const std::string& description);
    // By name: what addAsset() was given.
    const std::map<std::string, std::string>& addedAssets() const { return added_assets_; }

    // Makes a group's first edit as fast as the others. O(n).
    void open(uint32_t group);

    const Scene& scene() const { return scene_; }
    // O(groups, and what holds those that have changed).
    SceneChanges takeChanges();

    static constexpr size_t kFewUses = 16;

private:
    static constexpr uint32_t kGone = 0xffffffffu;  // in place of a slot or a name

    // What editing must know of a group beside its octree.
    struct OpenGroup {
        std::vector<uint32_t> parent;                    // of each node
        std::vector<uint32_t> merge_at;                  // of each node: as few are one leaf
        std::vector<uint32_t> rank_of;                   // by name: residents are in this order
        int built_height = 0;                            // levels below the root, as opened
        std::vector<uint32_t> slot_of;                   // by name; kGone
        std::vector<uint32_t> node_of;                   // by place
        std::vector<std::vector<uint32_t>> free_places;  // by the binary logarithm of their number
        std::vector<std::vector<uint32_t>> free_nodes;   // blocks of siblings, by their number
    };
    // In a group: how often another is instanced, and the most that it is enlarged there.
    struct Held {
        size_t count = 0;
        double length_scale = 0.0;
    };
    // How often a group is instanced, and where, if that is not often.
    struct Uses {
        size_t count = 0;
        std::vector<InstanceId> places;
    };

    OpenGroup& opened(uint32_t group);
    uint32_t slotOf(InstanceId id);
    void checkInsert(uint32_t group, ChildRef child, const Affine& group_from_child) const;
    void checkInserts(uint32_t group, const std::vector<NewInstance>& instances,
                      ThreadPool& pool) const;
    bool reaches(ChildRef from, uint32_t group) const;
    void addUse(InstanceId place, ChildRef child, double length_scale);
    void removeUse(InstanceId place, ChildRef child);

    void place(InstanceId id, ChildRef child, const Affine& group_from_child);
    void take(InstanceId id);
    static bool isBefore(const OpenGroup& open, uint32_t name_a, uint32_t name_b);
    uint32_t chooseNode(const Group& group, const DVec3& center, const DVec3& half) const;
    void addResident(uint32_t group, uint32_t node, uint32_t name, ChildRef child,
                     const Affine& group_from_child);
    void moveResident(uint32_t group, uint32_t from, uint32_t to, uint32_t node);
    uint32_t takePlaces(uint32_t group, uint32_t capacity);
    void freePlaces(uint32_t group, uint32_t first, uint32_t capacity);
    uint32_t takeNodes(uint32_t group, uint32_t count);
    void split(uint32_t group, uint32_t node);
    void collapse(uint32_t group, uint32_t node);
    uint32_t rebuildIfTooDeep(uint32_t group, uint32_t leaf);
    // Nodes whose sums are not up to date, by depth and group, so that what is within comes before
    // what holds it, and each group is summed up once; kGone: all of the group's; none: its bounds.
    using Dirty = std::map<std::pair<int, uint32_t>, std::vector<uint32_t>>;
    void refreshUpwards(uint32_t group, uint32_t node);
    void refresh(Dirty dirty);
    void refreshNodes(uint32_t group, const std::vector<uint32_t>& nodes);
    void groupChanged(uint32_t group, Dirty& dirty);
    void setOutgrown(uint32_t group, double length, Dirty& dirty);
    bool updateSlack(uint32_t holder);
    void addDirty(uint32_t group, uint32_t node, Dirty& dirty) const;
    void deepen(uint32_t group, int depth);
    int depthAbove(uint32_t group) const;
    void countInstances(uint32_t group, double instances, double triangles);
    void note(uint32_t group, uint32_t node);
    void noteMember(InstanceId id);
    void forgetIfTooMany();
    void noteBox(uint32_t group, const DBox3& box);
    void noteBox(uint32_t group, const DBox3& box, int& steps);
    std::vector<uint32_t> withHolders(std::vector<uint32_t> groups) const;
    void markEdited(InstanceId id);

    Scene& scene_;
    std::vector<std::unique_ptr<OpenGroup>> open_;   // by group
    std::vector<Uses> uses_;                         // by group
    std::vector<std::map<uint32_t, Held>> holders_;  // by group: the groups that hold it
    // By group: how far it stands out of what the groups that hold it know of its bounds.
    std::vector<double> outgrown_;
    SceneChanges changes_;
    std::vector<uint32_t> untold_;   // have changed, and the nodes that show them are not noted
    std::vector<uint32_t> rebuilt_;  // have other nodes, or another slack
    std::map<std::string, std::string> added_assets_;
};

}  // namespace stipple
