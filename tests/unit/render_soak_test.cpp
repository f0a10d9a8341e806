// SPDX-License-Identifier: Apache-2.0
// Random edits from one thread, a moving camera and frames from another, for as long as
// STIPPLE_SOAK_SECONDS says: nothing breaks, and memory does not grow. Made to be run with
// sanitizers, too.
#include <render/live_scene.h>

#include <core/rng.h>
#include <core/stopwatch.h>
#include <gtest/gtest.h>
#include <scenegraph/procedural/generators.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <thread>

namespace stipple {
namespace {

constexpr double kDefaultSeconds = 6.0;
constexpr uint32_t kTrees = 400, kTiles = 30, kTreesInTile = 60;

double soakSeconds() {
    const char* text = std::getenv("STIPPLE_SOAK_SECONDS");
    return text ? std::atof(text) : kDefaultSeconds;
}

size_t residentBytes() {
    size_t total = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> total >> resident;
    return resident * size_t(sysconf(_SC_PAGESIZE));
}

Affine randomPlace(Rng& rng, double side) {
    const double x = rng.uniform(-0.5, 0.5) * side, z = rng.uniform(-0.5, 0.5) * side;
    return {DMat3(rng.uniform(0.5, 1.5)), DVec3(x, 0.0, z)};
}

// Group 0, the root: ground (for the z-buffer), trees and tiles of trees, which are group 1.
Scene makeScene(ThreadPool& pool) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    TreeParams params;
    params.triangles = 1000;
    GeneratedMesh tree = makeTree(params), ground = makePrimitive("plane", 2, Vec3(0.4f));
    scene.materials = tree.materials;
    for (uint16_t& material : ground.mesh.triangle_material)
        material = uint16_t(material + scene.materials.size());
    scene.materials.push_back(ground.materials[0]);
    scene.meshes = {tree.mesh, ground.mesh};
    Rng rng{1};
    Group root, tile;
    root.name = "root", tile.name = "tile";
    root.instances = InstanceStore(DBox3{DVec3(-400.0), DVec3(400.0)});
    tile.instances = InstanceStore(DBox3{DVec3(-30.0), DVec3(30.0)});
    root.instances.add(ChildRef::mesh(1), {DMat3(600.0), DVec3(0.0)});
    for (uint32_t i = 0; i < kTrees; ++i)
        root.instances.add(ChildRef::mesh(0), randomPlace(rng, 300.0));
    for (uint32_t i = 0; i < kTiles; ++i) {
        const DVec3 at(50.0 * (i % 6) - 125.0, 0.0, -50.0 * (i / 6) - 150.0);
        root.instances.add(ChildRef::group(1), {DMat3(1.0), at});
    }
    for (uint32_t i = 0; i < kTreesInTile; ++i)
        tile.instances.add(ChildRef::mesh(0), randomPlace(rng, 40.0));
    scene.groups = {root, tile};
    buildScene(scene, pool);
    return scene;
}

// Inserts, moves, removals that come back later, and what must be refused.
class RandomEdits {
public:
    RandomEdits() {
        for (uint32_t i = 1; i <= kTrees; ++i) alive_.push_back({0, i});
        for (uint32_t i = 0; i < kTreesInTile; ++i) alive_.push_back({1, i});
        wanted_ = alive_.size();
    }

    void edit(SceneEditor& editor) {
        const double what = rng_.uniform(0.0, 1.0);
        const size_t k = any(alive_.size());
        const InstanceId id = alive_[k];
        const double side = id.group == 0 ? 300.0 : 40.0;
        if (what < 0.3) {
            editor.move(id, randomPlace(rng_, side));
        } else if (alive_.size() < wanted_) {
            if (what < 0.7 && !removed_.empty()) {
                const size_t r = any(removed_.size());
                editor.restore(removed_[r], ChildRef::mesh(0), randomPlace(rng_, side));
                alive_.push_back(removed_[r]);
                removed_[r] = removed_.back();
                removed_.pop_back();
            } else {
                alive_.push_back(
                    editor.insert(id.group, ChildRef::mesh(0), randomPlace(rng_, side)));
            }
        } else {
            for (int i = 0; i < 20; ++i) removeOne(editor);
        }
    }

private:
    size_t any(size_t n) { return std::min(n - 1, size_t(rng_.uniform(0.0, 1.0) * double(n))); }

    void removeOne(SceneEditor& editor) {
        const size_t k = any(alive_.size());
        editor.remove(alive_[k]);
        EXPECT_THROW(editor.move(alive_[k], Affine()), Error);
        removed_.push_back(alive_[k]);
        alive_[k] = alive_.back();
        alive_.pop_back();
        if (removed_.size() > 100) removed_.erase(removed_.begin());
    }

    Rng rng_{7};
    std::vector<InstanceId> alive_, removed_;
    size_t wanted_;
};

FrameRequest randomRequest(Rng& rng, double time) {
    constexpr Reconstruct kAll[] = {Reconstruct::kPerPixel, Reconstruct::kSplat,
                                    Reconstruct::kGaussian, Reconstruct::kPullPush,
                                    Reconstruct::kEwa,      Reconstruct::kBins};
    FrameRequest r;
    const DVec3 eye(250.0 * std::sin(time), 60.0 + 40.0 * std::sin(0.7 * time),
                    250.0 * std::cos(time));
    r.camera = lookAt(eye, DVec3(0, 0, -50));
    r.settings.width = 96, r.settings.height = 64;
    r.settings.subpixels = 1 + int(rng.uniform(0.0, 3.0));
    r.settings.reconstruct = kAll[std::min(5, int(rng.uniform(0.0, 6.0)))];
    r.settings.shadows = rng.uniform(0.0, 1.0) < 0.3;
    r.settings.ao = rng.uniform(0.0, 1.0) < 0.2;
    r.settings.large_triangle = rng.uniform(0.0, 1.0) < 0.5 ? 64.0 : 1024.0;
    r.settings.cache_mb = 4;  // less than all lists together
    r.aovs = {"depth", "object"};
    return r;
}

TEST(Soak, editsAndFramesFromTwoThreadsLeaveMemoryAsItIs) {
    const double seconds = soakSeconds();
    ThreadPool pool(2);
    LiveScene scene(makeScene(pool), pool);
    std::atomic<bool> is_done{false};
    uint64_t edits = 0;
    std::thread editor_thread([&] {
        RandomEdits random;
        while (!is_done) {
            scene.edit([&](SceneEditor& editor) {
                for (int i = 0; i < 10; ++i) random.edit(editor);
            });
            edits += 10;
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
    });
    CancelFlag cancel;
    Rng rng{3};
    const Stopwatch watch;
    size_t settled_bytes = 0, frames = 0, cancelled = 0;
    while (watch.seconds() < seconds) {
        FrameRequest r = randomRequest(rng, watch.seconds());
        std::thread canceller;
        r.cancel = &cancel;
        cancel.requested = false;
        if (rng.uniform(0.0, 1.0) < 0.2) {
            canceller = std::thread([&] {
                std::this_thread::sleep_for(std::chrono::milliseconds(3));
                cancel.requested = true;
            });
        }
        try {
            const Frame frame = scene.render(r);
            EXPECT_TRUE(std::none_of(frame.image.data.begin(), frame.image.data.end(),
                                     [](float value) { return std::isnan(value); }));
            ++frames;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::kCancelled) << error.what();
            ++cancelled;
        }
        if (canceller.joinable()) canceller.join();
        // Every way to draw has been taken by then.
        if (watch.seconds() < 0.4 * seconds) settled_bytes = residentBytes();
    }
    is_done = true;
    editor_thread.join();
    const double grown_mb = (double(residentBytes()) - double(settled_bytes)) / 1e6;
    std::printf("%zu frames, %zu cancelled, %llu edits; %.1f MB, grown by %.1f MB\n", frames,
                cancelled, static_cast<unsigned long long>(edits), double(settled_bytes) / 1e6,
                grown_mb);
    EXPECT_GT(frames, 5u);
    EXPECT_GT(edits, 50u);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // they keep what is freed
    // Names are never given again: 4 bytes for each insert stay, and what the allocator rounds up.
    EXPECT_LT(grown_mb, 8.0 + 0.05 * double(settled_bytes) / 1e6);
#endif
}

}  // namespace
}  // namespace stipple
