// SPDX-License-Identifier: Apache-2.0
// Splats beside rays through the surface that their points lie on: closed from everywhere, near and
// far, with every reconstruction; fewer as ellipses than as circles; cut along the edges of a box.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/splats.h>
#include <scenegraph/io/surfel_file.h>
#include <tests/image/model_views.h>
#include <tests/image/test_scene.h>

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace stipple {
namespace {

Scene sourceOf(GeneratedMesh made) {
    TestScene scene;
    scene.add(std::move(made), Affine());
    scene.build();
    scene.scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(2.0f)});
    return scene.scene;
}

// The model of the source as a file's text, and loaded again, in the same light.
Scene modelOf(const Scene& source, const SplatOptions& options, ThreadPool& pool,
              SplatReport& report) {
    const CancelFlag cancel;
    const std::filesystem::path path = std::filesystem::temp_directory_path() /
                                       ("stipple-splats-" + std::to_string(getpid()) + ".stipple");
    std::ofstream(path, std::ios::binary) << surfelFileText(buildSplats(
        source, options, pool, cancel, [](const char*, double) {}, report));
    Diagnostics diagnostics;
    Scene scene = loadScene(path.string(), {true, 0, nullptr}, pool, diagnostics);
    std::filesystem::remove(path);
    scene.lighting = source.lighting;
    return scene;
}

struct Seen {
    size_t holes = 0;
    double worst = 1e9, mean = 0.0;  // dB
    int worst_view = 0;
};

// From `views` directions, none with a height below `lowest`, the diagonal 60 to 200 pixels long.
Seen lookAround(const Scene& source, const Scene& model, int views, ThreadPool& pool,
                Reconstruct reconstruct = Reconstruct::kPerPixel, float lowest = -1.0f) {
    Seen seen;
    for (int i = 0, n = 0; n < views; ++i) {
        if (maskDirectionOf(i * 37 % kMaskDirections).y < lowest) continue;
        const Camera camera =
            cameraTo(source, maskDirectionOf(i * 37 % kMaskDirections), 60.0 + 1.4 * n, 128);
        const auto result =
            compareImages(draw(model, camera, 128, Method::kPoints, 1, pool, 2, reconstruct),
                          draw(source, camera, 128, Method::kRaycast, 16, pool), pool);
        seen.holes += result.holes->count;
        if (result.psnr < seen.worst) seen.worst = result.psnr, seen.worst_view = i;
        seen.mean += result.psnr / views;
        ++n;
    }
    return seen;
}

SplatOptions optionsOf(double tolerance, bool circles, int points = 40000) {
    SplatOptions options;
    options.tolerance = tolerance;
    options.are_circles = circles;
    options.points = points;
    return options;
}

GeneratedMesh box() { return makePrimitive("box", 12, Vec3(0.8f, 0.5f, 0.3f)); }
GeneratedMesh ring() { return makePrimitive("torus", 4000, Vec3(0.8f, 0.5f, 0.3f)); }

TEST(Splats, ellipsesAreFewerThanCirclesAndAsClosed) {
    ThreadPool pool(2);
    const Scene source = sourceOf(ring());
    SplatReport circles, ellipses;
    const Scene of_circles = modelOf(source, optionsOf(0.1, true), pool, circles),
                of_ellipses = modelOf(source, optionsOf(0.1, false), pool, ellipses);
    EXPECT_LT(double(ellipses.splats), 0.75 * double(circles.splats));
    EXPECT_LE(ellipses.largest_distance, ellipses.tolerance * 1.15);  // positions are rounded
    for (const Scene* model : {&of_circles, &of_ellipses}) {
        const Seen seen = lookAround(source, *model, 20, pool);
        EXPECT_EQ(seen.holes, 0u);
        EXPECT_GE(seen.worst, 28.0);
    }
}

// Splats a spacing wider than their points all around stand out over bumps (37.1 dB, the worst
// 34.6); not wider, they leave holes.
TEST(Splats, bumpsHaveNoFringeAndNoGaps) {
    ThreadPool pool(2);
    RockParams params;
    params.subdivisions = 5;
    const Scene source = sourceOf(makeRock(params));
    SplatReport report;
    const Scene model = modelOf(source, optionsOf(0.2, false, 20000), pool, report);
    const Seen seen = lookAround(source, model, 20, pool);
    EXPECT_EQ(seen.holes, 0u);
    EXPECT_GE(seen.mean, 37.6);
    EXPECT_GE(seen.worst, 35.0);
    // Hardly a splat holds more than its own point (32.1 dB if these begin narrow).
    const Scene coarse = modelOf(source, optionsOf(0.02, false, 6000), pool, report);
    const Seen seen_coarse = lookAround(source, coarse, 20, pool);
    EXPECT_EQ(seen_coarse.holes, 0u);
    EXPECT_GE(seen_coarse.mean, 35.0);
}

// What rays and the z-buffer meet, and what is drawn far away.
TEST(Splats, theMeshThatStandsForThemIsClosed) {
    ThreadPool pool(2);
    const Scene source = sourceOf(ring());
    SplatReport report;
    const Scene model = modelOf(source, optionsOf(0.1, false), pool, report);
    SplatOptions all = optionsOf(0.1, false, 100000);  // thinned to 40 000
    all.naive = true;
    const Scene naive = modelOf(source, all, pool, report);
    EXPECT_EQ(report.splats, 100000u);
    EXPECT_LE(naive.meshes[0].positions.size(), 40000u * 6);
    for (const Scene* shown : {&model, &naive}) {
        for (int i = 0; i < 10; ++i) {
            const Camera camera =
                cameraTo(source, maskDirectionOf(i * 37 % kMaskDirections), 80.0 + 20.0 * i, 128);
            const auto result =
                compareImages(draw(*shown, camera, 128, Method::kRaycast, 16, pool),
                              draw(source, camera, 128, Method::kRaycast, 16, pool), pool);
            EXPECT_EQ(result.holes->count, 0u) << i;
            EXPECT_GE(result.psnr, 26.0) << i;
        }
    }
}

// Splats reach beyond the points that they were made from; tiles that only such a rim lies in show
// it. Default cameras look at the points.
TEST(Splats, rimsAreDrawnWhereNothingElseIs) {
    ThreadPool pool(2);
    const Scene source = sourceOf(makePrimitive("plane", 2, Vec3(0.8f, 0.5f, 0.3f)));
    SplatReport report;
    SplatOptions options = optionsOf(0.5, false, 500);
    options.has_cuts = false;
    const Scene model = modelOf(source, options, pool, report);
    const Mesh& mesh = model.meshes[0];
    const float border = mesh.source_bounds.max.x, rim = mesh.bounds.max.x - border;
    ASSERT_GT(rim, 0.01f);
    EXPECT_NEAR(border, 0.5f, 0.02f);
    const DBox3 looked_at = sourceBounds(model);
    EXPECT_EQ(Vec3(looked_at.max), mesh.source_bounds.max);
    EXPECT_EQ(Vec3(sceneBounds(model).max), mesh.bounds.max);
    FrameRequest r;
    r.aovs = {"coverage"};
    const DVec3 at(double(border + 0.25f * rim), 0.0, 0.0);
    r.camera = lookAt(at + DVec3(0.0, 4.0, 0.01), at);
    r.camera.fov_y = 2.0 * std::atan(0.5 / 4.0);
    r.settings.width = r.settings.height = 384;
    for (const Method method : {Method::kPoints, Method::kRaycast, Method::kZBuffer}) {
        r.settings.method = method;
        r.settings.tile_size = 384;
        const Image whole = Renderer(model, pool).render(r).image;
        r.settings.tile_size = 16;
        const Image tiles = Renderer(model, pool).render(r).image;
        int shown = 0;
        for (int y = 0; y < 384; ++y) {
            for (int x = 0; x < 384; ++x) {
                const int c = whole.channelIndex("coverage");
                ASSERT_EQ(whole.pixel(x, y)[c], tiles.pixel(x, y)[c]) << x << " " << y;
                // The border lies a quarter of the rim left of the middle.
                shown += x > 193 && whole.pixel(x, y)[c] > 0.0f;
            }
        }
        EXPECT_GT(shown, 0) << int(method);
    }
}

TEST(Splats, edgesOfABoxStaySharp) {
    ThreadPool pool(2);
    const Scene source = sourceOf(box());
    SplatOptions cut = optionsOf(0.1, false), whole = cut;
    whole.has_cuts = false;
    SplatReport cut_report, whole_report;
    const Scene cut_model = modelOf(source, cut, pool, cut_report),
                whole_model = modelOf(source, whole, pool, whole_report);
    EXPECT_LT(cut_report.splats, whole_report.splats);
    for (const Reconstruct reconstruct : {Reconstruct::kPerPixel, Reconstruct::kEwa}) {
        const Seen of_cut = lookAround(source, cut_model, 20, pool, reconstruct),
                   of_whole = lookAround(source, whole_model, 20, pool, reconstruct);
        EXPECT_EQ(of_cut.holes, 0u) << int(reconstruct);
        EXPECT_GE(of_cut.worst, 30.0) << int(reconstruct);
        EXPECT_GT(of_cut.mean, of_whole.mean + 2.0) << int(reconstruct);
    }
}

// The farthest that anything drawn for a splat reaches from the middle along an axis.
float reachOf(const SurfelModel& model) {
    const SurfelLevel& level = model.levels[0];
    float reach = 0.0f;
    std::array<Vec3, kMostDiscCorners> corners;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const int n =
                discPolygon(level, s, kDiscSide * level.spacing * s.radius_share, corners);
            EXPECT_GE(n, 3) << "splat " << i;
            for (int c = 0; c < n; ++c) {
                const Vec3 p = glm::abs(s.position + corners[size_t(c)]);
                reach = std::max({reach, p.x, p.y, p.z});
            }
        }
    }
    return reach;
}

// At edges, but for the tolerance and the steps of positions.
TEST(Splats, nothingReachesBeyondABox) {
    ThreadPool pool(2);
    const CancelFlag cancel;
    const Scene source = sourceOf(box());
    // Of the last, some splats hold as many points as one may before they reach an edge.
    for (const SplatOptions& options :
         {optionsOf(0.1, false), optionsOf(0.5, false), optionsOf(0.02, false, 200000)}) {
        SplatReport report;
        const SurfelModel model = buildSplats(
            source, options, pool, cancel, [](const char*, double) {}, report);
        EXPECT_LE(reachOf(model), 0.5f + float(3.0 * report.tolerance)) << options.tolerance;
    }
}

// Where points end, splats end: a few spacings beyond, not half their width.
TEST(Splats, nothingReachesFarBeyondABorder) {
    ThreadPool pool(2);
    const CancelFlag cancel;
    const Scene source = sourceOf(makePrimitive("plane", 2, Vec3(0.8f, 0.5f, 0.3f)));
    constexpr int kPoints = 20000;
    const float spacing = 1.0f / std::sqrt(float(kPoints));
    for (const bool has_cuts : {false, true}) {
        SplatOptions options = optionsOf(0.1, false, kPoints);
        options.has_cuts = has_cuts;
        SplatReport report;
        const SurfelModel model = buildSplats(
            source, options, pool, cancel, [](const char*, double) {}, report);
        EXPECT_LT(report.splats, kPoints / 50);
        const float beyond = (reachOf(model) - 0.5f) / spacing;
        if (has_cuts)
            EXPECT_LE(beyond, 4.0f);
        else
            EXPECT_GE(beyond, 8.0f);
    }
}

TEST(Splats, everyReconstructionShowsEllipses) {
    ThreadPool pool(2);
    const Scene source = sourceOf(ring());
    SplatReport report;
    const Scene model = modelOf(source, optionsOf(0.1, false), pool, report);
    for (const Reconstruct reconstruct : kReconstructions) {
        const Seen seen = lookAround(source, model, 6, pool, reconstruct);
        EXPECT_GE(seen.worst, 41.5) << int(reconstruct);
        EXPECT_EQ(seen.holes, 0u) << int(reconstruct);
    }
}

// The lit side of a thin plate does not shine through it, however small it is in the picture.
TEST(Splats, whatLiesBehindAThinPartIsNotBlendedIn) {
    ThreadPool pool(2);
    TestScene scene;
    scene.add(box(), placed(DVec3(0.0), DVec3(1.0, 1.0, 0.04)));
    scene.build();
    scene.scene.lighting.suns.push_back({glm::normalize(Vec3(0.1f, 0.3f, 1.0f)), Vec3(4.0f)});
    const Scene source = scene.scene;
    SplatReport report;
    const Scene model = modelOf(source, optionsOf(0.1, false), pool, report);
    const Camera camera = cameraTo(source, glm::normalize(Vec3(0.2f, 0.1f, -1.0f)), 24.0, 48);
    const Image rays = draw(source, camera, 48, Method::kRaycast, 16, pool),
                image = draw(model, camera, 48, Method::kPoints, 4, pool, 1, Reconstruct::kEwa);
    double shown = 0.0, seen = 0.0;
    int n = 0;
    const int covered = rays.channelIndex("coverage");
    for (int y = 0; y < 48; ++y) {
        for (int x = 0; x < 48; ++x) {
            if (rays.pixel(x, y)[covered] < 1.0f) continue;
            shown += image.pixel(x, y)[0], seen += rays.pixel(x, y)[0], ++n;
        }
    }
    EXPECT_GT(n, 100);
    EXPECT_NEAR(shown / seen, 1.0, 0.03);
}

// Splats larger than their distance begin behind the eye and end far before it.
TEST(Splats, aPlaneIsClosedFromJustAboveIt) {
    ThreadPool pool(2);
    const Scene source = sourceOf(makePrimitive("plane", 2, Vec3(0.8f, 0.5f, 0.3f)));
    SplatReport report;
    const Scene model = modelOf(source, optionsOf(0.5, false, 20000), pool, report);
    EXPECT_LT(report.splats, 1000);
    for (const double height : {0.003, 0.03, 0.1}) {
        const Camera camera = lookAt(DVec3(0.02, height, 0.03), DVec3(0.3, 0.0, -0.3));
        const Image rays = draw(source, camera, 128, Method::kRaycast, 16, pool);
        const int covered = rays.channelIndex("coverage");
        for (const Reconstruct reconstruct : kReconstructions) {
            const Image image = draw(model, camera, 128, Method::kPoints, 1, pool, 2, reconstruct);
            int open = 0, beyond = 0;
            for (int y = 0; y < 128; ++y) {
                for (int x = 0; x < 128; ++x) {
                    const float of_plane = rays.pixel(x, y)[covered],
                                shown = image.pixel(x, y)[image.channelIndex("coverage")];
                    open += of_plane >= 1.0f && shown < 0.5f;
                    // Splats reach beyond the plane's borders, but not above the horizon.
                    beyond += y < 20 && of_plane <= 0.0f && shown > 0.0f;
                }
            }
            EXPECT_EQ(open, 0) << height << " " << int(reconstruct);
            EXPECT_EQ(beyond, 0) << height << " " << int(reconstruct);
        }
    }
}

// Seen close, where shadow maps know depths more exactly than the splats have them.
TEST(Splats, curvedSurfacesCastNoShadowsOnThemselves) {
    ThreadPool pool(2);
    Scene source = sourceOf(ring());
    source.lighting.suns[0].direction_to_light = glm::normalize(Vec3(-1.0f, 0.35f, 0.3f));
    SplatReport report;
    const Scene model = modelOf(source, optionsOf(0.1, false), pool, report);
    FrameRequest r;
    r.camera = cameraTo(source, glm::normalize(Vec3(-0.2f, 0.9f, 0.6f)), 700.0, 384);
    r.settings.width = r.settings.height = 384;
    r.settings.subpixels = 2;
    // 1: all of the sun's light, 0: none that is seen.
    const auto lightOf = [&](const Scene& scene, Method method) {
        r.settings.method = method;
        r.settings.samples = method == Method::kRaycast ? 16 : 1;
        r.settings.shadows = false;
        const Image open = Renderer(scene, pool).render(r).image;
        r.settings.shadows = true;
        const Image shaded = Renderer(scene, pool).render(r).image;
        std::vector<float> light;
        for (int y = 0; y < r.settings.height; ++y) {
            for (int x = 0; x < r.settings.width; ++x)
                light.push_back(shaded.pixel(x, y)[1] / open.pixel(x, y)[1]);
        }
        return light;
    };
    const std::vector<float> rays = lightOf(source, Method::kRaycast),
                             maps = lightOf(model, Method::kPoints);
    int lit = 0, shaded = 0, dark = 0, bright = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
        lit += rays[i] > 0.99f, dark += rays[i] > 0.99f && maps[i] < 0.9f;
        shaded += rays[i] < 0.7f, bright += rays[i] < 0.7f && maps[i] > 0.9f;
    }
    EXPECT_GT(shaded, 1000);
    EXPECT_LT(double(dark), 0.002 * double(lit));
    EXPECT_LT(double(bright), 0.01 * double(shaded));
}

// A scan from 100 directions: no hole, alike in the mean, and fewer ellipses than circles. The
// worst views, near and above, must not become worse.
TEST(Splats, aScanIsClosedFromAbove) {
    const char* folder = std::getenv("STIPPLE_TEST_DATA");
    if (!folder || !*folder) GTEST_SKIP() << "no test data (STIPPLE_TEST_DATA)";
    const std::filesystem::path mesh = std::filesystem::path(folder) / "meshes/bunny/bunny.glb",
                                cloud = std::filesystem::path(folder) /
                                        "pointclouds/bunny_points_normals.ply";
    if (!std::filesystem::exists(mesh) || !std::filesystem::exists(cloud))
        GTEST_SKIP() << "no test data " << mesh << " or " << cloud;
    ThreadPool pool(2);
    Diagnostics diagnostics;
    Scene source = loadScene(mesh.string(), {true, 0, nullptr}, pool, diagnostics);
    const Scene points = loadScene(cloud.string(), {true, 0, nullptr}, pool, diagnostics);
    SplatReport circles, ellipses;
    modelOf(points, optionsOf(0.1, true), pool, circles);
    Scene model = modelOf(points, optionsOf(0.1, false), pool, ellipses);
    model.lighting = source.lighting;
    EXPECT_LT(ellipses.splats, circles.splats);
    for (const Reconstruct reconstruct : {Reconstruct::kPerPixel, Reconstruct::kEwa}) {
        // Not from below, where the scan has holes of its own that flat splats close.
        const Seen seen = lookAround(source, model, 100, pool, reconstruct, -0.2f);
        EXPECT_EQ(seen.holes, 0u) << int(reconstruct);
        EXPECT_GE(seen.mean, 33.8) << int(reconstruct);
        EXPECT_GE(seen.worst, 28.0)
            << int(reconstruct) << ", worst " << seen.worst << " in view " << seen.worst_view;
    }
}

}  // namespace
}  // namespace stipple
