// SPDX-License-Identifier: Apache-2.0
// The octree over a group's instances: its invariants, and the same bits for any number of threads.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/scene.h>

#include <cstring>

namespace stipple {
namespace {

// n boxes of very different sizes, some stretched.
Scene boxes(size_t n, int threads) {
    Scene scene;
    scene.path = "test";
    GeneratedMesh box = makePrimitive("box", 12, Vec3(0.5f));
    scene.materials = box.materials;
    scene.meshes.push_back(box.mesh);
    Group& group = scene.groups.emplace_back();
    group.name = "all";
    group.instances = InstanceStore(DBox3{DVec3(-100), DVec3(100)});
    Rng rng{3};
    for (size_t i = 0; i < n; ++i) {
        const double size = std::exp2(rng.uniform(-6.0, 3.0));
        const DMat3 m =
            i % 10 == 0 ? DMat3(size, 0, 0, 0, 2 * size, 0, 0.1 * size, 0, size) : DMat3(size);
        group.instances.add(ChildRef::mesh(0), {m, DVec3(rng.uniform(-100, 100), rng.uniform(-1, 1),
                                                         rng.uniform(-100, 100))});
    }
    ThreadPool pool(threads);
    buildScene(scene, pool);
    return scene;
}

TEST(ScenegraphGroupBuild, nodesPartitionTheInstancesAndBoundThem) {
    for (const size_t n : {size_t(0), size_t(1), size_t(50), size_t(100000)}) {
        const Scene scene = boxes(n, 2);
        const Group& group = scene.groups[0];
        ASSERT_FALSE(group.nodes.empty());
        EXPECT_EQ(group.nodes[0].count, n);
        EXPECT_EQ(group.instances_total, double(n));
        std::vector<int> residents(n, 0), listed(n, 0);
        size_t reached = 0;
        std::vector<uint32_t> open{0};
        while (!open.empty()) {
            const GroupNode& node = group.nodes[open.back()];
            open.pop_back();
            ++reached;
            uint32_t next = node.first + node.resident_count;
            double area = 0.0;
            for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
                EXPECT_EQ(group.nodes[c].first, next);
                next += group.nodes[c].count;
                area += group.nodes[c].area;
                open.push_back(c);
            }
            ASSERT_EQ(next, node.first + node.count);
            for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
                ++residents[i];
                const DBox3 box =
                    transformBox(group.instances.groupFromChild(i), scene.meshes[0].bounds);
                for (int axis = 0; axis < 3; ++axis) {
                    ASSERT_GE(box.min[axis], double(node.bounds.min[axis]) - 1e-9);
                    ASSERT_LE(box.max[axis], double(node.bounds.max[axis]) + 1e-9);
                }
                area += scene.meshes[0].area * group.instances.areaScale(i);
            }
            ASSERT_NEAR(node.area, area, 1e-9 * area);
        }
        EXPECT_EQ(reached, group.nodes.size());
        for (const int r : residents) ASSERT_EQ(r, 1);
        for (const uint32_t i : group.listed_index) ++listed[i];
        for (const int l : listed) ASSERT_EQ(l, 1);
    }
}

TEST(ScenegraphGroupBuild, isTheSameForAnyNumberOfThreads) {
    const Scene one = boxes(200000, 1), four = boxes(200000, 4);
    const Group &a = one.groups[0], &b = four.groups[0];
    EXPECT_EQ(a.listed_index, b.listed_index);
    ASSERT_EQ(a.nodes.size(), b.nodes.size());
    for (size_t i = 0; i < a.nodes.size(); ++i) {
        const GroupNode &x = a.nodes[i], &y = b.nodes[i];
        ASSERT_EQ(x.bounds.min, y.bounds.min);
        ASSERT_EQ(x.bounds.max, y.bounds.max);
        ASSERT_EQ(std::memcmp(&x.area, &y.area, sizeof x.area), 0);
        ASSERT_EQ(std::tie(x.max_triangle_area, x.first, x.count, x.resident_count, x.first_child,
                           x.child_count),
                  std::tie(y.max_triangle_area, y.first, y.count, y.resident_count, y.first_child,
                           y.child_count));
    }
}

TEST(ScenegraphGroupBuild, anInstanceTakesAtMost48Bytes) {
    Scene scene = boxes(0, 1);
    Group& group = scene.groups[0];
    for (int i = 0; i < 100000; ++i)
        group.instances.add(ChildRef::mesh(0),
                            {DMat3(0.1), DVec3(i % 320 * 0.3, 0, i / 320 * 0.3)});
    ThreadPool pool(2);
    buildScene(scene, pool);
    EXPECT_LE(group.bytes(), 48u * 100000u);
}

TEST(ScenegraphGroupBuild, refusesNestingThatDrawingCouldNotDescend) {
    for (const int depth : {kDeepestNesting, kDeepestNesting + 1}) {
        Scene scene = boxes(1, 1);
        for (int level = 1; level < depth; ++level) {
            Group& group = scene.groups.emplace_back();
            group.name = "level " + std::to_string(level);
            group.instances.add(ChildRef::group(uint32_t(level - 1)), {});
        }
        scene.root = uint32_t(depth - 1);
        ThreadPool pool(1);
        if (depth <= kDeepestNesting) {
            EXPECT_NO_THROW(buildScene(scene, pool));
        } else {
            EXPECT_THROW(buildScene(scene, pool), Error);
        }
    }
}

TEST(ScenegraphGroupBuild, namesTheFirstInstanceThatIsSingular) {
    Scene scene = boxes(0, 1);
    for (int i = 0; i < 50000; ++i) {
        DMat3 m(1.0);
        if (i > 40000) m[1] = DVec3(0.0);
        scene.groups[0].instances.add(ChildRef::mesh(0), {m, DVec3(0.001 * i, 0, 0)});
    }
    ThreadPool pool(3);
    try {
        buildScene(scene, pool);
        FAIL();
    } catch (const Error& e) {
        EXPECT_STREQ(e.what(), "test: /groups/all/40001: singular transform");
    }
}

}  // namespace
}  // namespace stipple
