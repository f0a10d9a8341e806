// SPDX-License-Identifier: Apache-2.0
// Edits: whatever is done to a scene, its octrees are as good as those of a scene built so.
#include <scenegraph/scene_editor.h>

#include <core/rng.h>
#include <gtest/gtest.h>
#include <sampling/list_point.h>
#include <sampling/point_list.h>
#include <scenegraph/group_sums.h>
#include <scenegraph/procedural/generators.h>

#include <cstring>
#include <map>

namespace stipple {
namespace {

Affine randomPlace(Rng& rng, double spread) {
    const double size = std::exp2(rng.uniform(-3.0, 2.0)), angle = rng.uniform(0.0, 6.0);
    const double s = std::sin(angle) * size, c = std::cos(angle) * size;
    DMat3 m(c, 0, -s, 0, size, 0, s, 0, c);
    if (rng.uniform(0.0, 1.0) < 0.1) m[1] *= 2.5;  // no similarity
    return {m, DVec3(rng.uniform(-spread, spread), rng.uniform(-5.0, 5.0),
                     rng.uniform(-spread, spread))};
}

// Group 0, the root, holds boxes and spheres and `tiles` instances of group 1, which holds some
// more.
Scene makeScene(size_t n, size_t tiles) {
    Scene scene;
    scene.path = "test";
    GeneratedMesh box = makePrimitive("box", 12, Vec3(0.5f));
    scene.materials = box.materials;
    scene.meshes.push_back(box.mesh);
    scene.meshes.push_back(makePrimitive("sphere", 100, Vec3(0.5f)).mesh);
    Rng rng{3};
    Group root, tile;
    root.name = "root";
    tile.name = "tile";
    root.instances = InstanceStore(DBox3{DVec3(-500), DVec3(500)});
    tile.instances = InstanceStore(DBox3{DVec3(-20), DVec3(20)});
    for (size_t i = 0; i < n; ++i)
        root.instances.add(ChildRef::mesh(uint32_t(i % 2)), randomPlace(rng, 500.0));
    for (size_t i = 0; i < tiles; ++i)
        root.instances.add(ChildRef::group(1), {DMat3(1.0), DVec3(40.0 * double(i), 0, 600)});
    for (size_t i = 0; i < 60; ++i)
        tile.instances.add(ChildRef::mesh(uint32_t(i % 2)), randomPlace(rng, 20.0));
    scene.groups = {root, tile};
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

// Group 2, the root, shows makeScene()'s root so often and so large.
Scene makeWorld(size_t n, size_t tiles, int times, double scale) {
    Scene scene = makeScene(n, tiles);
    Group world;
    world.name = "world";
    for (int i = 0; i < times; ++i)
        world.instances.add(ChildRef::group(0), {DMat3(scale), DVec3(2000.0 * i, 0, 0)});
    scene.groups.push_back(world);
    scene.root = 2;
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

int treeDepth(const Group& group, uint32_t node = 0) {
    int depth = 0;
    for (uint32_t c = 0; c < group.nodes[node].child_count; ++c)
        depth = std::max(depth, treeDepth(group, group.nodes[node].first_child + c));
    return depth + 1;
}

// Every instance resides once, nodes enclose and sum up what is below. Returns how many there are.
size_t checkOctree(const Scene& scene, const Group& group) {
    std::map<uint32_t, int> names;
    std::vector<uint32_t> open{0};
    while (!open.empty()) {
        const GroupNode& node = group.nodes[open.back()];
        open.pop_back();
        double area = 0.0;
        uint32_t count = node.resident_count;
        for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
            const ChildRef child = group.instances.child(i);
            EXPECT_FALSE(child.isNone());
            ++names[group.listed_index[i]];
            DVec3 center, half;
            const ChildSums sums = childSums(scene, child);
            instanceBox(sums, group.instances.groupFromChild(i), center, half);
            for (int axis = 0; axis < 3; ++axis) {
                EXPECT_GE(center[axis] - half[axis], double(node.bounds.min[axis]) - 1e-9);
                EXPECT_LE(center[axis] + half[axis], double(node.bounds.max[axis]) + 1e-9);
            }
            area += sums.area * group.instances.areaScale(i);
        }
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const GroupNode& child = group.nodes[c];
            area += child.area;
            count += child.count;
            if (child.area > 0.0) {
                EXPECT_TRUE(glm::all(glm::lessThanEqual(node.bounds.min, child.bounds.min)));
                EXPECT_TRUE(glm::all(glm::greaterThanEqual(node.bounds.max, child.bounds.max)));
            }
            open.push_back(c);
        }
        EXPECT_EQ(count, node.count);
        EXPECT_NEAR(node.area, area, 1e-12 * area);
    }
    size_t live = 0;
    for (size_t i = 0; i < group.instances.size(); ++i) live += !group.instances.child(i).isNone();
    EXPECT_EQ(names.size(), live);
    for (const auto& [name, n] : names) EXPECT_EQ(n, 1) << name;
    return names.size();
}

// The same instances, built.
Scene builtAnew(const Scene& scene) {
    Scene fresh = scene;
    ThreadPool pool(2);
    buildScene(fresh, pool);
    return fresh;
}

// Keeps to what is alive.
void editAtRandom(SceneEditor& editor, std::vector<InstanceId>& alive, uint32_t group, int count,
                  double spread, Rng& rng) {
    for (int i = 0; i < count; ++i) {
        const double what = rng.uniform(0.0, 1.0);
        const size_t k =
            std::min(alive.size() - 1, size_t(rng.uniform(0.0, 1.0) * double(alive.size())));
        if (what < 0.34) {
            alive.push_back(
                editor.insert(group, ChildRef::mesh(uint32_t(i % 2)), randomPlace(rng, spread)));
        } else if (what < 0.67 && alive.size() > 10) {
            editor.remove(alive[k]);
            alive[k] = alive.back();
            alive.pop_back();
        } else if (what < 0.95) {
            editor.move(alive[k], randomPlace(rng, spread));
        } else {
            editor.replace(alive[k], ChildRef::mesh(uint32_t(i % 2)));
        }
    }
}

std::vector<InstanceId> idsOf(const Scene& scene, uint32_t group) {
    std::vector<InstanceId> ids;
    for (size_t i = 0; i < scene.groups[group].instances.size(); ++i) {
        const ChildRef child = scene.groups[group].instances.child(i);
        if (!child.isNone() && !child.isGroup())
            ids.push_back({group, scene.groups[group].listed_index[i]});
    }
    return ids;
}

TEST(SceneEditor, afterManyEditsTheOctreeIsAsGoodAsOneBuilt) {
    Scene scene = makeScene(3000, 5);
    SceneEditor editor(scene);
    Rng rng{7};
    std::vector<InstanceId> alive = idsOf(scene, 0);
    for (int round = 0; round < 5; ++round) {
        editAtRandom(editor, alive, 0, 20000, 500.0, rng);
        EXPECT_EQ(checkOctree(scene, scene.groups[0]), alive.size() + 5);
    }
    const Scene fresh = builtAnew(scene);
    const Group &a = scene.groups[0], &b = fresh.groups[0];
    EXPECT_NEAR(a.area, b.area, 1e-9 * b.area);
    EXPECT_EQ(a.instances_total, b.instances_total);
    EXPECT_EQ(a.triangles_total, b.triangles_total);
    EXPECT_LE(treeDepth(a), 2 * treeDepth(b));
    EXPECT_LE(a.nodes.size(), 4 * b.nodes.size());
    EXPECT_LE(a.instances.size(), 4 * b.instances.size()) << "places are used again";
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(a.bounds.min[axis], b.bounds.min[axis], 1e-3);
        EXPECT_NEAR(a.bounds.max[axis], b.bounds.max[axis], 1e-3);
    }
}

TEST(SceneEditor, removedInstancesAreRefusedAndCanComeBack) {
    Scene scene = makeScene(100, 0);
    SceneEditor editor(scene);
    const double area = scene.groups[0].area;
    const InstanceId id{0, 17};
    const Affine where = editor.groupFromChild(id);
    const ChildRef what = editor.child(id);
    editor.remove(id);
    EXPECT_FALSE(editor.contains(id));
    EXPECT_THROW(editor.remove(id), Error);
    EXPECT_THROW(editor.move(id, where), Error);
    EXPECT_LT(scene.groups[0].area, area);
    const InstanceId other = editor.insert(0, what, where);
    EXPECT_EQ(other.index, 100u) << "names are never given twice";
    editor.remove(other);
    editor.restore(id, what, where);
    EXPECT_TRUE(editor.contains(id));
    EXPECT_NEAR(scene.groups[0].area, area, 1e-12 * area);
    EXPECT_THROW(editor.restore(id, what, where), Error);
    checkOctree(scene, scene.groups[0]);
}

TEST(SceneEditor, whatCannotBeChangesNothing) {
    Scene scene = makeScene(50, 3);
    SceneEditor editor(scene);
    const double area = scene.groups[0].area;
    const Affine flat{DMat3(1, 0, 0, 0, 0, 0, 0, 0, 1), DVec3(0)};
    const Affine nowhere{DMat3(1.0), DVec3(std::nan(""))};
    EXPECT_THROW(editor.insert(0, ChildRef::mesh(0), flat), Error);
    EXPECT_THROW(editor.insert(0, ChildRef::mesh(0), nowhere), Error);
    EXPECT_THROW(editor.insert(0, ChildRef::mesh(0), {DMat3(1e305), DVec3(0)}), Error) << "too far";
    EXPECT_THROW(editor.insert(0, ChildRef::mesh(9), Affine()), Error);
    EXPECT_THROW(editor.insert(9, ChildRef::mesh(0), Affine()), Error);
    EXPECT_THROW(editor.insert(1, ChildRef::group(0), Affine()), Error) << "a cycle";
    EXPECT_THROW(editor.insert(0, ChildRef::group(0), Affine()), Error) << "a cycle";
    EXPECT_THROW(editor.move({0, 3}, flat), Error);
    EXPECT_THROW(editor.check({1, 3}, ChildRef::group(0), Affine()), Error);
    EXPECT_THROW(editor.find({}), Error);
    EXPECT_THROW(editor.find({3, 0}), Error) << "a mesh has nothing below";
    EXPECT_THROW(editor.findOwn({50, 999}), Error);
    EXPECT_EQ(scene.groups.size(), 2u);
    EXPECT_EQ(scene.groups[0].area, area);
    EXPECT_FALSE(editor.takeChanges().any);
}

TEST(SceneEditor, aGroupChangesEverywhereOrInOnePlace) {
    for (const size_t tiles : {size_t(3), size_t(40)}) {  // few places, and many
        Scene scene = makeScene(50, tiles);
        SceneEditor editor(scene);
        const double instances = scene.groups[0].instances_total;
        editor.remove(editor.find({50, 7}));
        EXPECT_EQ(scene.groups[0].instances_total, instances - double(tiles));
        const uint32_t mine = editor.findOwn({51, 9}).group;
        EXPECT_EQ(mine, 2u);
        EXPECT_EQ(editor.findOwn({51, 9}).group, mine) << "it is its own already";
        editor.remove(editor.find({51, 9}));
        EXPECT_EQ(scene.groups[0].instances_total, instances - double(tiles) - 1.0);
        EXPECT_TRUE(editor.contains({1, 9}));
        EXPECT_FALSE(editor.contains({mine, 9}));
        // Much larger: it reaches beyond where it was.
        editor.insert(1, ChildRef::mesh(0), {DMat3(60.0), DVec3(0, 100, 0)});
        for (const Group& group : scene.groups) checkOctree(scene, group);
        const Scene fresh = builtAnew(scene);
        EXPECT_NEAR(scene.groups[0].area, fresh.groups[0].area, 1e-9 * scene.groups[0].area);
        EXPECT_NEAR(scene.groups[0].bounds.max.y, fresh.groups[0].bounds.max.y, 1e-3);
    }
}

// What is below every node, wherever the groups now are, lies within its bounds and slack.
void expectEnclosed(const Scene& scene, const Group& group) {
    for (uint32_t n = 0; n < group.nodes.size(); ++n) {
        const Box3 bounds = nodeBounds(group, n);
        const GroupNode& node = group.nodes[n];
        for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
            const ChildRef child = group.instances.child(i);
            ChildSums sums = childSums(scene, child);
            if (child.isGroup()) sums.bounds = scene.groups[child.index()].bounds;
            DVec3 center, half;
            instanceBox(sums, group.instances.groupFromChild(i), center, half);
            EXPECT_TRUE(glm::all(glm::lessThanEqual(DVec3(bounds.min) - 1e-6, center - half)));
            EXPECT_TRUE(glm::all(glm::greaterThanEqual(DVec3(bounds.max) + 1e-6, center + half)));
        }
    }
}

// Where a group is instanced often, what stands out of its bounds costs as little as what does not.
TEST(SceneEditor, groupsInstancedOftenMayOutgrowTheirBounds) {
    Scene scene = makeWorld(50, 40, 30, 0.5);
    const Scene before = scene;
    SceneEditor editor(scene);
    editor.open(1);
    const Affine above{DMat3(1.0), DVec3(0, before.groups[1].bounds.max.y + 3.0, 0)};
    const InstanceId id = editor.insert(1, ChildRef::mesh(0), above);
    SceneChanges changes = editor.takeChanges();
    for (const SceneChanges::Node& node : changes.nodes) EXPECT_EQ(node.group, 1u);
    EXPECT_EQ(changes.whole_groups.size(), 2u) << "what holds it may show something else";
    for (const Group& group : scene.groups) expectEnclosed(scene, group);
    EXPECT_NEAR(scene.groups[0].slack, 3.5, 0.1);
    EXPECT_GT(scene.groups[2].bounds.max.y, before.groups[2].bounds.max.y);

    editor.remove(id);
    for (size_t g = 0; g < 3; ++g) {
        EXPECT_EQ(scene.groups[g].slack, 0.0f);
        EXPECT_NEAR(scene.groups[g].bounds.max.y, before.groups[g].bounds.max.y, 1e-4);
    }

    // What comes to hold it needs slack, too, as large as it is shown there.
    editor.restore(id, ChildRef::mesh(0), above);
    const InstanceId larger = editor.insert(0, ChildRef::group(1), {DMat3(5.0), DVec3(0)}),
                     other = editor.insert(2, ChildRef::group(1), {DMat3(2.0), DVec3(0)});
    for (const Group& group : scene.groups) expectEnclosed(scene, group);
    EXPECT_NEAR(scene.groups[0].slack, 17.5, 0.5);
    editor.remove(larger);
    editor.remove(other);
    for (const Group& group : scene.groups) expectEnclosed(scene, group);
    editor.remove(id);

    // So far out that slack would serve nobody.
    editor.takeChanges();
    editor.insert(1, ChildRef::mesh(0), {DMat3(1.0), DVec3(0, 1000, 0)});
    changes = editor.takeChanges();
    EXPECT_GT(changes.nodes.size(), before.groups[0].nodes.size());
    for (const Group& group : scene.groups) {
        EXPECT_EQ(group.slack, 0.0f);
        expectEnclosed(scene, group);
        checkOctree(scene, group);
    }
}

TEST(SceneEditor, manyAtOnceAreAsOneByOne) {
    for (const size_t n : {size_t(20), size_t(5000)}) {
        Scene scene = makeScene(1000, 2);
        SceneEditor editor(scene);
        editor.remove({0, 5});
        std::vector<SceneEditor::NewInstance> more;
        Rng rng{5};
        for (size_t i = 0; i < n; ++i) more.push_back({ChildRef::mesh(0), randomPlace(rng, 700.0)});
        ThreadPool pool(2);
        const InstanceId first = editor.insertMany(0, more, pool);
        EXPECT_EQ(first.index, 1002u);
        EXPECT_EQ(checkOctree(scene, scene.groups[0]), 1001 + n);
        EXPECT_FALSE(editor.contains({0, 5}));
        for (size_t i = 0; i < n; i += 7) {
            const Affine at = editor.groupFromChild({0, first.index + uint32_t(i)});
            EXPECT_NEAR(glm::length(at.translation - more[i].group_from_child.translation), 0.0,
                        1e-5);
        }
        EXPECT_EQ(scene.groups[0].instances_total, double(999 + n + 2 * 60));
    }
}

// Instances are drawn in proportion to their areas, as they now are.
TEST(SceneEditor, pointsFallOnInstancesByTheirAreas) {
    Scene scene = makeScene(300, 0);
    SceneEditor editor(scene);
    Rng rng{11};
    std::vector<InstanceId> alive = idsOf(scene, 0);
    editAtRandom(editor, alive, 0, 30000, 500.0, rng);
    const Group& group = scene.groups[0];
    constexpr int kDraws = 400000;
    std::map<uint32_t, double> along, chosen;
    for (int i = 0; i < kDraws; ++i) {
        ++along[instanceAt(scene, group, 0, rng.uniform(0.0, 1.0)).instance];
        WayNumbers way({Sampler::kStratified, rng.next(), uint32_t(i)});
        ++chosen[chooseInstance(scene, group, 0, way).instance];
    }
    for (auto& hits : {along, chosen}) {
        double chi_square = 0.0, categories = 0.0;
        for (uint32_t i = 0; i < group.instances.size(); ++i) {
            if (group.instances.child(i).isNone()) continue;
            const double expected = kDraws * childArea(scene, group.instances.child(i)) *
                                    group.instances.areaScale(i) / group.area;
            if (expected < 10.0) continue;
            const double d = (hits.contains(i) ? hits.at(i) : 0.0) - expected;
            chi_square += d * d / expected;
            ++categories;
        }
        ASSERT_GT(categories, 50.0);
        EXPECT_LT(chi_square, categories + 4.0 * std::sqrt(2.0 * categories));
    }
}

bool areSame(const ListBlock& a, const ListBlock& b) {
    const auto same = [](const auto& x, const auto& y) {
        return std::memcmp(&x, &y, sizeof x) == 0;
    };
    return same(a.position, b.position) && same(a.normal, b.normal) && same(a.width, b.width) &&
           same(a.single_sided, b.single_sided) && same(a.alpha, b.alpha) &&
           same(a.normal_or_triangle, b.normal_or_triangle) &&
           same(a.albedo_or_place, b.albedo_or_place) && same(a.material, b.material) &&
           same(a.instance, b.instance) && same(a.levels, b.levels) && same(a.branch, b.branch) &&
           same(a.box, b.box);
}

// Uses all lists of a group, which must be what they would be if they were made now.
size_t expectLists(const Scene& scene, PointLists& lists, uint32_t group_index) {
    PointLists fresh(scene);
    ThreadPool pool(1);
    fresh.startFrame(lists.identity(), 0, pool);
    const ChildRef group = ChildRef::group(group_index);
    size_t n = 0;
    for (uint32_t node = 0; node < scene.groups[group_index].nodes.size(); ++node) {
        if (!lists.hasLists(group) || !(scene.groups[group_index].nodes[node].area > 0.0)) continue;
        for (uint32_t first = 0; first < 512; first += 64) {
            ListBlock scratch_a, scratch_b;
            int lane = 0;
            const ListBlock& a = lists.points({group, node}, first, 64, 512, scratch_a, lane);
            const ListBlock& b = fresh.points({group, node}, first, 64, 512, scratch_b, lane);
            EXPECT_TRUE(areSame(a, b)) << "node " << node << ", points from " << first;
        }
        ++n;
    }
    return n;
}

// One list's points fall on a group's instances, and on what is within these, evenly.
TEST(SceneEditor, aListsPointsAreSpreadEvenly) {
    Scene scene = makeScene(1, 0);
    Group row, field;
    for (int i = 0; i < 32; ++i)
        row.instances.add(ChildRef::mesh(0), {DMat3(1.0), DVec3(2.0 * i, 0, 0)});
    for (int i = 0; i < 32; ++i)
        field.instances.add(ChildRef::group(0), {DMat3(1.0), DVec3(0, 0, 2.0 * i)});
    scene.groups = {row, field};
    scene.root = 1;
    ThreadPool pool(1);
    buildScene(scene, pool);
    const ListIdentity identity;
    const ListName name{ChildRef::group(1), 0};
    std::map<uint32_t, int> hits;  // by the path to one of 1024 boxes
    constexpr int kAsMany = 16, kAll = 1024 * kAsMany;
    for (uint32_t first = 0; first < kAll; first += kBlockPoints) {
        ListBlock block;
        makeListPoints({scene, identity, name}, first, kBlockPoints, block);
        for (const uint32_t path : block.instance) ++hits[path];
    }
    EXPECT_EQ(hits.size(), 1024u) << "random ones leave none out, either";
    double chi_square = 0.0;
    for (const auto& [path, n] : hits)
        chi_square += double((n - kAsMany) * (n - kAsMany)) / kAsMany;
    EXPECT_LT(chi_square, 0.75 * 1024) << "random ones have 1024";
}

// Lists of what did not change are kept; all hold what they would if they were made now.
TEST(SceneEditor, cachedPointsFollow) {
    Scene scene = makeScene(50, 20);
    SceneEditor editor(scene);
    PointLists lists(scene);
    ASSERT_TRUE(lists.hasLists(ChildRef::group(1)));
    ThreadPool pool(2);
    const ListIdentity identity;
    Rng rng{13};
    std::vector<InstanceId> alive = idsOf(scene, 1);
    for (int round = 0; round < 20; ++round) {
        lists.startFrame(identity, size_t(64) << 20, pool);
        ASSERT_GT(expectLists(scene, lists, 1), 0u);
        const size_t before = lists.bytes();
        editAtRandom(editor, alive, 1, round % 3 == 0 ? 1 : 50, 20.0, rng);
        lists.sceneChanged(editor.takeChanges());
        EXPECT_LT(lists.bytes(), before);
        if (round % 3 == 0 && scene.groups[1].nodes.size() > 8) {
            EXPECT_GT(lists.bytes(), 0u) << "the others are kept";
        }
    }
}

// Of groups of groups, too, where the groups within are edited.
TEST(SceneEditor, cachedPointsOfNestedGroupsFollow) {
    Scene scene = makeWorld(20, 3, 10, 1.0);
    ThreadPool pool(2);
    SceneEditor editor(scene);
    PointLists lists(scene);
    ASSERT_TRUE(lists.hasLists(ChildRef::group(0)));
    Rng rng{17};
    std::vector<InstanceId> inner = idsOf(scene, 1), outer;
    for (const InstanceId id : idsOf(scene, 0))
        if (!editor.child(id).isGroup()) outer.push_back(id);
    for (int round = 0; round < 20; ++round) {
        lists.startFrame({}, size_t(64) << 20, pool);
        ASSERT_GT(expectLists(scene, lists, 0), 0u);
        editAtRandom(editor, inner, 1, 1 + round % 3, 20.0, rng);
        if (round % 2 == 0) editAtRandom(editor, outer, 0, 1, 500.0, rng);
        lists.sceneChanged(editor.takeChanges());
    }
}

// An edit changes about as many points as what it changes has.
TEST(SceneEditor, cachedPointsChangeOnlyWhereTheSceneDoes) {
    Scene scene = makeScene(50, 20);
    SceneEditor editor(scene);
    const std::vector<InstanceId> alive = idsOf(scene, 1);
    const ListIdentity identity;
    const ListName name{ChildRef::group(1), 0};
    constexpr int kBlocks = 64;
    const auto listNow = [&] {
        std::vector<ListBlock> blocks(kBlocks);
        for (int b = 0; b < kBlocks; ++b)
            makeListPoints({scene, identity, name}, uint32_t(b * kBlockPoints), kBlockPoints,
                           blocks[size_t(b)]);
        return blocks;
    };
    double changed = 0.0, expected = 0.0;
    for (const InstanceId id : alive) {
        const std::vector<ListBlock> before = listNow();
        const ChildRef child = editor.child(id);
        const Affine place = editor.groupFromChild(id);
        const double share =
            childArea(scene, child) * maxAreaScale(place.linear) / scene.groups[1].nodes[0].area;
        editor.remove(id);
        const std::vector<ListBlock> after = listNow();
        editor.restore(id, child, place);
        if (!(before[0].box.min == after[0].box.min && before[0].box.max == after[0].box.max))
            continue;
        expected += share * kBlocks * kBlockPoints;
        for (size_t b = 0; b < kBlocks; ++b) {
            for (int lane = 0; lane < kBlockPoints; ++lane)
                changed += before[b].position[0][lane] != after[b].position[0][lane];
        }
        EXPECT_TRUE(areSame(listNow()[0], before[0])) << "undone";
    }
    ASSERT_GT(expected, 200.0);
    EXPECT_GT(changed, 0.9 * expected);
    EXPECT_LT(changed, 5.0 * expected);
}

// A group that is built anew may have far fewer nodes than its lists know of.
TEST(SceneEditor, listsFollowAGroupThatIsBuiltAnew) {
    Scene scene = makeScene(50, 20);
    SceneEditor editor(scene);
    PointLists lists(scene);
    ThreadPool pool(2);
    Rng rng{29};
    std::vector<SceneEditor::NewInstance> many(3000, {ChildRef::mesh(0), Affine()});
    for (auto& i : many) i.group_from_child = randomPlace(rng, 20.0);
    editor.insertMany(1, many, pool);
    lists.sceneChanged(editor.takeChanges());
    lists.startFrame({}, size_t(64) << 20, pool);
    ListBlock scratch;
    int lane = 0;
    const size_t nodes_before = scene.groups[1].nodes.size();
    for (uint32_t node = 0; node < nodes_before; ++node)
        lists.points({ChildRef::group(1), node}, 0, 64, 128, scratch, lane);
    for (const InstanceId id : idsOf(scene, 1)) editor.remove(id);
    many.resize(40);
    editor.insertMany(1, many, pool);
    ASSERT_LT(scene.groups[1].nodes.size(), nodes_before / 2);
    lists.sceneChanged(editor.takeChanges());
    lists.startFrame({}, size_t(64) << 20, pool);
    const ListBlock& root = lists.points({ChildRef::group(1), 0}, 0, 64, 128, scratch, lane);
    for (const uint32_t instance : root.instance)
        ASSERT_LT(instance, scene.groups[1].instances.size());
}

// Each level holds the next four times: 10^9 places of the innermost.
TEST(SceneEditor, editsOfDeeplyNestedGroupsTakeAsManyStepsAsThereAreGroups) {
    constexpr uint32_t kLevels = 15;
    Scene scene;
    scene.path = "test";
    GeneratedMesh box = makePrimitive("box", 12, Vec3(0.5f));
    scene.materials = box.materials;
    scene.meshes.push_back(box.mesh);
    for (uint32_t level = 0; level < kLevels; ++level) {
        Group group;
        group.name = std::to_string(level);
        const double side = std::exp2(double(kLevels - level));
        group.instances = InstanceStore(DBox3{DVec3(-side), DVec3(side)});
        for (int i = 0; i < 4; ++i) {
            const DVec3 corner(i & 1 ? side / 2 : -side / 2, 0.0, i & 2 ? side / 2 : -side / 2);
            group.instances.add(
                level + 1 < kLevels ? ChildRef::group(level + 1) : ChildRef::mesh(0),
                {DMat3(1.0), corner});
        }
        scene.groups.push_back(std::move(group));
    }
    ThreadPool pool(2);
    buildScene(scene, pool);
    const double area = scene.groups[0].area;
    SceneEditor editor(scene);
    const InstanceId id =
        editor.insert(kLevels - 1, ChildRef::mesh(0), {DMat3(1.0), DVec3(0.25, 0.0, 0.25)});
    EXPECT_NEAR(scene.groups[0].area, area * 5.0 / 4.0, area * 1e-9);
    EXPECT_EQ(scene.groups[0].instances_total, 5.0 * std::pow(4.0, kLevels - 1));
    const SceneChanges changes = editor.takeChanges();
    EXPECT_TRUE(changes.anywhere);
    EXPECT_LT(changes.nodes.size(), 200u);
    editor.remove(id);
    EXPECT_NEAR(scene.groups[0].area, area, area * 1e-9);
    EXPECT_EQ(scene.groups[0].instances_total, std::pow(4.0, kLevels));
}

TEST(SceneEditor, groupsAreNestedNoDeeperThanScenesMayBe) {
    Scene scene = makeScene(4, 0);
    scene.groups.resize(kDeepestNesting + 8);
    for (size_t g = 2; g < scene.groups.size(); ++g) {
        scene.groups[g].name = std::to_string(g);
        scene.groups[g].instances = InstanceStore(DBox3{DVec3(-1), DVec3(1)});
    }
    ThreadPool pool(2);
    buildScene(scene, pool);
    SceneEditor editor(scene);
    // Each into the one before.
    int depth = 1;
    uint32_t holder = 0;
    const auto nest = [&] {
        for (uint32_t g = 2; g < scene.groups.size(); ++g, ++depth) {
            editor.insert(holder, ChildRef::group(g), Affine());
            holder = g;
        }
    };
    EXPECT_THROW(nest(), Error);
    EXPECT_EQ(depth, kDeepestNesting);
    EXPECT_EQ(scene.groups[0].depth, kDeepestNesting);
}

}  // namespace
}  // namespace stipple
