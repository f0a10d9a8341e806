// SPDX-License-Identifier: Apache-2.0
// A million random edits: sums, octree, times and pictures stay as good as those of a scene that is
// built so.
#include <render/live_scene.h>

#include <core/rng.h>
#include <core/stopwatch.h>
#include <gtest/gtest.h>
#include <render/compare.h>
#include <scenegraph/procedural/generators.h>

#include <algorithm>

namespace stipple {
namespace {

constexpr int kEdits = 1000000;
constexpr uint32_t kTrees = 20000, kTiles = 40, kTreesInTile = 200;
constexpr double kSide = 1000.0, kTileSide = 50.0;

// Places of trees are spread evenly, so that edits change which trees there are, not what the
// scene is like.
Affine randomPlace(Rng& rng, double side) {
    const double size = rng.uniform(0.7, 1.3), angle = rng.uniform(0.0, 6.28);
    const double s = std::sin(angle) * size, c = std::cos(angle) * size;
    const double x = rng.uniform(-0.5, 0.5) * side, z = rng.uniform(-0.5, 0.5) * side;
    return {DMat3(c, 0, -s, 0, size, 0, s, 0, c), DVec3(x, 0.0, z)};
}

// Group 0, the root: trees, and beside them tiles of trees, all the same group 1.
Scene makeForest(ThreadPool& pool) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    for (const char* species : {"oak", "spruce"}) {
        TreeParams params;
        params.species = species;
        params.triangles = 3000;
        GeneratedMesh tree = makeTree(params);
        for (uint16_t& material : tree.mesh.triangle_material)
            material = uint16_t(material + scene.materials.size());
        scene.materials.insert(scene.materials.end(), tree.materials.begin(), tree.materials.end());
        scene.meshes.push_back(std::move(tree.mesh));
    }
    Rng rng{1};
    Group root, tile;
    root.name = "root", tile.name = "tile";
    root.instances = InstanceStore(DBox3{DVec3(-2.0 * kSide), DVec3(2.0 * kSide)});
    tile.instances = InstanceStore(DBox3{DVec3(-kTileSide), DVec3(kTileSide)});
    for (uint32_t i = 0; i < kTrees; ++i)
        root.instances.add(ChildRef::mesh(i % 2), randomPlace(rng, kSide));
    for (uint32_t i = 0; i < kTiles; ++i) {
        const DVec3 at(kTileSide * (double(i % 20) - 9.5), 0, kSide / 2 + kTileSide * (i / 20 + 1));
        root.instances.add(ChildRef::group(1), {DMat3(1.0), at});
    }
    for (uint32_t i = 0; i < kTreesInTile; ++i)
        tile.instances.add(ChildRef::mesh(i % 2), randomPlace(rng, kTileSide));
    scene.groups = {root, tile};
    buildScene(scene, pool);
    return scene;
}

struct Trees {
    uint32_t group;
    double side;
    uint32_t count;  // about as many there shall be
    std::vector<InstanceId> alive;

    Trees(uint32_t g, double s, uint32_t n) : group(g), side(s), count(n) {
        for (uint32_t i = 0; i < n; ++i) alive.push_back({g, i});
    }
};

// As many inserts as removals in the long run.
void editOnce(SceneEditor& editor, Trees& trees, Rng& rng) {
    const double what = rng.uniform(0.0, 1.0);
    const size_t k = std::min(trees.alive.size() - 1,
                              size_t(rng.uniform(0.0, 1.0) * double(trees.alive.size())));
    const ChildRef child = ChildRef::mesh(rng.uniform(0.0, 1.0) < 0.5);
    const bool has_few = double(trees.alive.size()) < double(trees.count) * rng.uniform(0.95, 1.05);
    if (what < 0.7 && has_few) {
        trees.alive.push_back(editor.insert(trees.group, child, randomPlace(rng, trees.side)));
    } else if (what < 0.7) {
        editor.remove(trees.alive[k]);
        trees.alive[k] = trees.alive.back();
        trees.alive.pop_back();
    } else if (what < 0.9) {
        editor.move(trees.alive[k], randomPlace(rng, trees.side));
    } else {
        editor.replace(trees.alive[k], child);
    }
}

int treeDepth(const Group& group, uint32_t node = 0) {
    int depth = 0;
    for (uint32_t c = 0; c < group.nodes[node].child_count; ++c)
        depth = std::max(depth, treeDepth(group, group.nodes[node].first_child + c));
    return depth + 1;
}

FrameRequest request(Method method) {
    FrameRequest r;
    r.camera = lookAt(DVec3(0, 200, 900), DVec3(0, 0, 200));
    r.settings.width = 240, r.settings.height = 160;
    r.settings.subpixels = 2;
    r.settings.method = method;
    r.settings.samples = method == Method::kRaycast ? 64 : 1;
    return r;
}

// Mean of some seeds.
double psnrAgainstRays(LiveScene& scene, ThreadPool& pool) {
    constexpr int kSeeds = 3;
    const Image rays = scene.render(request(Method::kRaycast)).image;
    double sum = 0.0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        FrameRequest r = request(Method::kPoints);
        r.settings.seed = uint64_t(seed);
        sum += compareImages(scene.render(r).image, rays, pool).psnr;
    }
    return sum / kSeeds;
}

// The shortest of frames that take turns, so that what else the machine does falls on both alike.
double frameTimeRatio(LiveScene& a, LiveScene& b) {
    double seconds[2] = {1e9, 1e9};
    for (int i = 0; i < 15; ++i) {
        seconds[0] = std::min(seconds[0], a.render(request(Method::kPoints)).stats.seconds);
        seconds[1] = std::min(seconds[1], b.render(request(Method::kPoints)).stats.seconds);
    }
    return seconds[0] / seconds[1];
}

TEST(ManyEdits, aMillionLeaveTheSceneAsGoodAsOneBuiltSo) {
    ThreadPool pool(2);
    LiveScene edited(makeForest(pool), pool);
    const double psnr_before = psnrAgainstRays(edited, pool);
    Rng rng{5};
    Scene fresh;
    edited.edit([&](SceneEditor& editor) {
        Trees all[2] = {{0, kSide, kTrees}, {1, kTileSide, kTreesInTile}};
        const Stopwatch watch;
        for (int i = 0; i < kEdits; ++i) editOnce(editor, all[rng.uniform(0.0, 1.0) < 0.1], rng);
        std::printf("%.2f us an edit\n", watch.seconds() / kEdits * 1e6);
        fresh = editor.scene();
        buildScene(fresh, pool);
        for (uint32_t g = 0; g < 2; ++g) {
            const Group &a = editor.scene().groups[g], &b = fresh.groups[g];
            // The root's sums may lag behind the tile's: they are compared without it.
            EXPECT_EQ(a.instances_total, b.instances_total);
            EXPECT_LE(treeDepth(a), 2 * treeDepth(b));
            const double lag = g == 0 ? kTiles * (editor.scene().groups[1].as_child.area -
                                                  fresh.groups[1].as_child.area)
                                      : 0.0;
            EXPECT_NEAR(a.area - lag, b.area, 1e-6 * b.area);
            std::printf("group %u: depth %d, built %d; area off by %.1e\n", g, treeDepth(a),
                        treeDepth(b), std::abs(a.area - lag - b.area) / b.area);
        }
    });
    const double psnr_after = psnrAgainstRays(edited, pool);
    EXPECT_GT(psnr_after, psnr_before - 0.3);
    LiveScene built(std::move(fresh), pool);
    EXPECT_GT(psnr_after, psnrAgainstRays(built, pool) - 0.3);
    const double ratio = frameTimeRatio(edited, built);
    EXPECT_LT(ratio, 1.2);
    std::printf("PSNR %.2f dB before, %.2f dB after; frame time %.2fx\n", psnr_before, psnr_after,
                ratio);
}

// What comes and goes again leaves nothing behind, in no reconstruction.
TEST(ManyEdits, insertingAndRemovingTheSameLeavesTheSamePicture) {
    ThreadPool pool(2);
    LiveScene scene(makeForest(pool), pool);
    for (const Reconstruct reconstruct : {Reconstruct::kPerPixel, Reconstruct::kGaussian}) {
        FrameRequest r = request(Method::kPoints);
        r.settings.reconstruct = reconstruct;
        r.aovs = {"depth", "object"};
        const Image before = scene.render(r).image;
        std::vector<InstanceId> planted;
        scene.edit([&](SceneEditor& editor) {
            Rng rng{9};
            for (int i = 0; i < 40; ++i) {
                planted.push_back(editor.insert(0, ChildRef::mesh(0), randomPlace(rng, kSide)));
                planted.push_back(editor.insert(1, ChildRef::mesh(1), randomPlace(rng, kTileSide)));
            }
        });
        EXPECT_NE(scene.render(r).image.data, before.data);
        scene.edit([&](SceneEditor& editor) {
            for (const InstanceId& id : planted) editor.remove(id);
            for (const InstanceId& id : planted) EXPECT_THROW(editor.remove(id), Error);
        });
        EXPECT_EQ(scene.render(r).image.data, before.data);
    }
}

}  // namespace
}  // namespace stipple
