// SPDX-License-Identifier: Apache-2.0
// Every source of points with every reconstruction: alone and all in one picture, perspective and
// orthographic, before and after one of each was inserted, moved and removed, beside rays through
// what the models were made of.
#include "test_scene.h"

#include <gtest/gtest.h>
#include <render/build_model.h>
#include <render/compare.h>
#include <scenegraph/io/hybrid.h>
#include <scenegraph/io/hybrid_file.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/splats.h>
#include <scenegraph/io/surfel_file.h>
#include <scenegraph/scene_editor.h>

#include <filesystem>
#include <fstream>

namespace stipple {
namespace {

namespace fs = std::filesystem;

// What a scene file calls it, and what the rays are cast through.
struct Source {
    const char* name;
    const char* asset;
    const char* original;
};
constexpr const char* kRing =
    R"({"generate": "torus", "triangles": 20000, "color": [0.8, 0.5, 0.3]})";
constexpr const char* kGrid =
    R"({"generate": "grid", "surface": "torus", "resolution": [256, 128], "color": [0.8, 0.5, 0.3],
        "displacement": {"file": "ripples.png", "low": -0.04, "high": 0.04}})";
constexpr const char* kCloud = R"({"file": "cloud.ply"})";
constexpr Source kSources[] = {
    {"mesh", kRing, kRing},
    {"point blocks", R"({"file": "blocks.stipple"})", kRing},
    {"splats", R"({"file": "splats.stipple"})", kRing},
    {"hybrid", R"({"file": "hybrid.stipple"})", kRing},
    {"displaced grid", kGrid, kGrid},
    {"point cloud", kCloud, kCloud},
};
constexpr int kSourceCount = int(std::size(kSources));

// The ring's vertices, with normals: dense enough for discs.
void writeCloud(const fs::path& path) {
    const Mesh mesh = makePrimitive("torus", 60000, Vec3(0.8f)).mesh;
    std::ofstream out(path);
    out << "ply\nformat ascii 1.0\nelement vertex " << mesh.positions.size()
        << "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
           "property float ny\nproperty float nz\nend_header\n";
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 &p = mesh.positions[i], &n = mesh.normals[i];
        out << p.x << ' ' << p.y << ' ' << p.z << ' ' << n.x << ' ' << n.y << ' ' << n.z << '\n';
    }
}

// Rings around the tube.
void writeRipples(const fs::path& path) {
    Image image(256, 128, {"R", "G", "B"});
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            const float height = 0.5f + 0.5f * std::sin(float(x) * float(2.0 * kPi) / 16.0f);
            for (int c = 0; c < 3; ++c) image.pixel(x, y)[c] = height;
        }
    }
    saveImage(image, path.string());
}

// A folder with the models of the ring, made once.
class Matrix : public testing::Test {
protected:
    static void SetUpTestSuite() {
        folder_ = fs::temp_directory_path() / ("stipple-matrix-" + std::to_string(getpid()));
        fs::create_directories(folder_);
        ThreadPool pool(2);
        const CancelFlag cancel;
        const auto quiet = [](auto&&...) {};
        const Scene ring = load(std::string(R"("a": )") + kRing, R"({"child": "a"})", pool);
        PointBlockOptions blocks;
        blocks.resolution = 128;
        PointBlockReport blocks_report;
        save("blocks.stipple", surfelFileText(buildPointBlockModel(ring, blocks, pool, cancel,
                                                                   quiet, blocks_report)));
        SplatOptions splats;
        splats.points = 60000;
        SplatReport splats_report;
        save("splats.stipple",
             surfelFileText(buildSplats(ring, splats, pool, cancel, quiet, splats_report)));
        HybridReport hybrid_report;
        save("hybrid.stipple", hybridFileText(buildHybrid(ring, HybridOptions(), pool, cancel,
                                                          quiet, hybrid_report)));
        writeCloud(folder_ / "cloud.ply");
        writeRipples(folder_ / "ripples.png");
    }
    static void TearDownTestSuite() { fs::remove_all(folder_); }

    static void save(const char* name, const std::string& text) {
        saveFile((folder_ / name).string(), text);
    }
    static Scene load(const std::string& assets, const std::string& instances, ThreadPool& pool) {
        const std::string text = R"({"version": 1, "assets": {)" + assets +
                                 R"(}, "groups": {"all": {"instances": [)" + instances +
                                 R"(]}}, "root": "all", "lights": {"suns": [{"direction":
            [0.4, 0.7, 0.5], "irradiance": [2, 2, 2]}]}})";
        const fs::path path = folder_ / "matrix.scene.json";
        std::ofstream(path) << text;
        Diagnostics diagnostics;
        return loadScene(path.string(), {true, 0, nullptr}, pool, diagnostics);
    }

    // Two instances of each of those sources, or of what they were made of.
    static Scene scene(int first, int last, bool original, ThreadPool& pool) {
        std::string assets = R"("floor": {"generate": "plane", "triangles": 2,
            "color": [0.35, 0.4, 0.35]})",
                    instances = R"({"child": "floor", "scale": 60, "translation": [0, -1, 0]})";
        for (int i = first; i < last; ++i) {
            const std::string asset = "a" + std::to_string(i);
            assets +=
                ", \"" + asset + "\": " + (original ? kSources[i].original : kSources[i].asset);
            const double x = 1.6 * (i - 0.5 * (first + last - 1));
            instances += R"(, {"child": ")" + asset + R"(", "translation": [)" + std::to_string(x) +
                         R"(, 0, 0], "rotation": [60, 20, 0]}, {"child": ")" + asset +
                         R"(", "translation": [)" + std::to_string(x + 0.5) +
                         R"(, 1.0, -3], "rotation": [10, 50, 30], "scale": 1.5})";
        }
        return load(assets, instances, pool);
    }

    static FrameRequest request(int count, bool orthographic) {
        FrameRequest r;
        r.camera = lookAt(DVec3(0.5, 2.5, 5.5 + 0.6 * count), DVec3(0, 0.2, -1));
        r.camera.orthographic = orthographic;
        r.camera.height = 3.2 + 0.35 * count;
        r.settings.width = count > 1 ? 320 : 160;
        r.settings.height = 120;
        r.aovs = {"depth", "coverage"};
        return r;
    }
    static Image rays(const Scene& scene, FrameRequest r, ThreadPool& pool) {
        r.settings.method = Method::kRaycast;
        r.settings.samples = 16;
        return Renderer(scene, pool).render(r).image;
    }
    static void expectLikeRays(const Image& picture, const Image& rays, const std::string& what,
                               ThreadPool& pool) {
        const CompareResult result = compareImages(picture, rays, pool);
        EXPECT_GE(result.psnr, 40.0) << what;
        ASSERT_TRUE(result.holes) << what;
        // Of the 16 subpixels of a pixel one may be open where a silhouette is steep.
        EXPECT_LE(result.holes->fraction, 3e-4) << what;
    }

    static fs::path folder_;
};
fs::path Matrix::folder_;

std::string nameOf(const FrameRequest& r) {
    return settingValue(r.settings, "reconstruct") + (r.camera.orthographic ? " orthographic" : "");
}

TEST_F(Matrix, eachSourceAloneLooksLikeRays) {
    ThreadPool one(1), pool(2), seven(7);
    for (int i = 0; i < kSourceCount; ++i) {
        const Scene drawn = scene(i, i + 1, false, pool), original = scene(i, i + 1, true, pool);
        for (const bool orthographic : {false, true}) {
            FrameRequest r = request(1, orthographic);
            const Image reference = rays(original, r, pool);
            for (const Reconstruct reconstruct : kReconstructions) {
                r.settings.reconstruct = reconstruct;
                const std::string what = std::string(kSources[i].name) + ", " + nameOf(r);
                const Image picture = Renderer(drawn, pool).render(r).image;
                expectLikeRays(picture, reference, what, pool);
                for (ThreadPool* other : {&one, &seven})
                    EXPECT_EQ(Renderer(drawn, *other).render(r).image.data, picture.data) << what;
            }
        }
    }
}

// One more of each source, one of each moved, one removed; the floor is instance 0.
void edit(Scene& scene, Renderer* renderer) {
    SceneEditor editor(scene);
    const uint32_t root = scene.root;
    for (int i = 0; i < kSourceCount; ++i) {
        const InstanceId near_id = editor.find({uint32_t(1 + 2 * i)}),
                         far_id = editor.find({uint32_t(2 + 2 * i)});
        const ChildRef child = editor.child(near_id);
        Affine at = editor.groupFromChild(near_id);
        editor.remove(far_id);
        at.translation += DVec3(0.1, 0.9, -1.0);
        editor.insert(root, child, at);
        at.translation += DVec3(-0.1, -0.7, 1.4);
        editor.move(near_id, at);
    }
    const SceneChanges changes = editor.takeChanges();
    if (renderer) renderer->sceneChanged(changes);
}

TEST_F(Matrix, allTogetherLookLikeRaysBeforeAndAfterEdits) {
    ThreadPool one(1), pool(2), seven(7);
    for (const bool orthographic : {false, true}) {
        Scene drawn = scene(0, kSourceCount, false, pool),
              original = scene(0, kSourceCount, true, pool);
        FrameRequest r = request(kSourceCount, orthographic);
        Renderer renderer(drawn, pool);
        for (const bool is_edited : {false, true}) {
            if (is_edited) edit(drawn, &renderer), edit(original, nullptr);
            const Image reference = rays(original, r, pool);
            for (const Reconstruct reconstruct : kReconstructions) {
                r.settings.reconstruct = reconstruct;
                const std::string what = nameOf(r) + (is_edited ? ", edited" : "");
                const Image picture = renderer.render(r).image;
                expectLikeRays(picture, reference, what, pool);
                for (ThreadPool* other : {&one, &seven})
                    EXPECT_EQ(Renderer(drawn, *other).render(r).image.data, picture.data) << what;
            }
        }
    }
}

}  // namespace
}  // namespace stipple
