// SPDX-License-Identifier: Apache-2.0
// Splats from point clouds: every point lies within the tolerance of a splat, but for
// the steps that positions are kept in, there are far fewer
// of them, they face outwards, and odd clouds are handled.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/splats.h>
#include <scenegraph/surface_at.h>
#include <scenegraph/surfel_finish.h>
#include <tests/image/test_scene.h>

#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace stipple {
namespace {

// A scene of the PLY cloud with these lines.
Scene cloudScene(const std::vector<std::string>& lines, const char* properties) {
    const std::string path = (std::filesystem::temp_directory_path() /
                              ("stipple-cloud-" + std::to_string(getpid()) + ".ply"))
                                 .string();
    std::ofstream file(path);
    file << "ply\nformat ascii 1.0\nelement vertex " << lines.size() << "\n"
         << "property float x\nproperty float y\nproperty float z\n"
         << properties << "end_header\n";
    for (const std::string& line : lines) file << line << "\n";
    file.close();
    ThreadPool pool(2);
    Diagnostics diagnostics;
    Scene scene = loadScene(path, {true, 0, nullptr}, pool, diagnostics);
    std::filesystem::remove(path);
    return scene;
}

std::vector<std::string> spherePoints(int n) {
    std::vector<std::string> lines;
    for (int i = 0; i < n; ++i) {
        const double z = 1.0 - (2.0 * i + 1.0) / n, a = 2.399963 * i, r = std::sqrt(1 - z * z);
        lines.push_back(std::to_string(r * std::cos(a)) + " " + std::to_string(z) + " " +
                        std::to_string(r * std::sin(a)));
    }
    return lines;
}

SurfelModel build(const Scene& scene, const SplatOptions& options, SplatReport& report,
                  int threads = 2) {
    ThreadPool pool(threads);
    const CancelFlag cancel;
    return buildSplats(
        scene, options, pool, cancel, [](const char*, double) {}, report);
}

// Over the splats of a sphere, half an ellipse from their middles.
TEST(Splats, normalsTurnWithTheSurface) {
    SplatOptions options;
    options.tolerance = 0.4;
    SplatReport report;
    const SurfelModel model = build(cloudScene(spherePoints(20000), ""), options, report);
    EXPECT_LT(report.splats, 400u);
    const SurfelLevel& level = model.levels[0];
    ASSERT_EQ(level.bends.size(), level.size());
    double of_planes = 0.0, of_fields = 0.0;  // degrees
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const std::array<Vec3, 2> axes = s.axes();
            for (const Vec3& axis : {axes[0], -axes[0], axes[1], -axes[1]}) {
                const Vec3 offset = axis * (0.5f * level.spacing * s.radius_share);
                const Vec3 is = glm::normalize(s.position + offset);
                const Vec3 field = bentNormal(level, s, model.discSide(), offset);
                const double degrees = 180.0 / kPi;
                of_planes += std::acos(std::min(glm::dot(s.normal, is), 1.0f)) * degrees;
                of_fields += std::acos(std::min(glm::dot(field, is), 1.0f)) * degrees;
            }
        }
    }
    const double n = 4.0 * double(level.size());
    EXPECT_GT(of_planes / n, 3.0);
    EXPECT_LT(of_fields / n, 1.0);
}

// Of positions: they are rounded to half of it.
double longestStep(const SurfelModel& model) {
    float longest = 0.0f;
    for (const SurfelBlock& block : model.levels[0].blocks)
        longest = std::max(longest, glm::length(SurfelLevel::step(block)));
    return double(longest);
}

// Positions are kept in steps of blocks, which end where nothing is.
TEST(Splats, reportSaysHowFarPointsAreFromWhatTheModelKeeps) {
    std::vector<std::string> lines;
    Rng rng{4};
    for (int object = 0; object < 40; ++object) {
        const double x = rng.uniform(-500, 500), y = rng.uniform(-5, 5), z = rng.uniform(-500, 500);
        for (int i = 0; i < 25; ++i) {
            lines.push_back(std::to_string(x + 0.05 * (i % 5)) + " " + std::to_string(y) + " " +
                            std::to_string(z + 0.05 * (i / 5)));
        }
    }
    const Scene scene = cloudScene(lines, "");
    SplatOptions options;
    options.tolerance = 0.001;  // of 1.4 km
    SplatReport report;
    const SurfelModel model = build(scene, options, report);
    EXPECT_GT(report.largest_distance, 0.0);
    EXPECT_LE(report.largest_distance, 0.01);
    for (const SurfelBlock& block : model.levels[0].blocks)
        EXPECT_LT(glm::length(block.bounds.extent()), 40.0f);
}

TEST(Splats, coverASphereWithinTheToleranceAndFaceOutwards) {
    const Scene scene = cloudScene(spherePoints(20000), "");
    SplatOptions options;
    SplatReport coarse, fine;
    options.tolerance = 0.2;
    const SurfelModel model = build(scene, options, coarse);
    EXPECT_EQ(coarse.points, 20000u);
    EXPECT_LE(coarse.largest_distance, coarse.tolerance + longestStep(model));
    EXPECT_LT(coarse.splats, 2000u);
    options.tolerance = 0.05;
    const SurfelModel fine_model = build(scene, options, fine);
    EXPECT_GT(fine.splats, 2 * coarse.splats);
    EXPECT_LE(fine.largest_distance, fine.tolerance + longestStep(fine_model));
    const SurfelLevel& level = model.levels[0];
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            EXPECT_GT(glm::dot(s.normal, glm::normalize(s.position)), 0.97f);
        }
    }
}

TEST(Splats, sameForAnyThreads) {
    const Scene scene = cloudScene(spherePoints(3000), "");
    SplatReport a, b;
    const SurfelModel one = build(scene, SplatOptions(), a, 1),
                      three = build(scene, SplatOptions(), b, 3);
    EXPECT_EQ(one.levels[0].position, three.levels[0].position);
    EXPECT_EQ(one.levels[0].radius, three.levels[0].radius);
}

TEST(Splats, coloursAreKept) {
    std::vector<std::string> lines;
    for (int i = 0; i < 100; ++i) {
        for (int j = 0; j < 100; ++j)
            lines.push_back(std::to_string(i * 0.01) + " 0 " + std::to_string(j * 0.01) +
                            (i < 50 ? " 255 0 0" : " 0 0 255"));
    }
    const Scene scene =
        cloudScene(lines, "property uchar red\nproperty uchar green\nproperty uchar blue\n");
    SplatReport report;
    const SurfelModel model = build(scene, SplatOptions(), report);
    const SurfelLevel& level = model.levels[0];
    EXPECT_LT(level.size(), 1000u);
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            EXPECT_GT(s.position.x < 0.495f ? s.albedo.r : s.albedo.b, 0.9f);
        }
    }
}

// Spheres that run into each other, one of them small and low: whoever guesses from the points
// where outside is turns some inside out.
TEST(Splats, surfacesFaceAsTheirMeshesDo) {
    const std::vector<std::pair<DVec3, double>> spheres = {{{0, 2, 0}, 2.0},
                                                           {{0.7, 1.1, 0.2}, 1.2},
                                                           {{-0.6, 1.0, 0.5}, 1.1},
                                                           {{0.1, 0.2, 0.6}, 0.8},
                                                           {{3, 0, 0}, 1.0}};
    TestScene scene;
    // The last is mirrored.
    for (const auto& [center, size] : spheres)
        scene.add(makePrimitive("sphere", 200, Vec3(0.5f)),
                  placed(center, DVec3(center.x < 3.0 ? size : -size, size, size)));
    SplatOptions options;
    options.points = 5000;
    SplatReport report;
    const SurfelModel model = build(scene.build(), options, report);
    EXPECT_EQ(report.points, 25000u);
    const SurfelLevel& level = model.levels[0];
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            // Of one of those that it lies on.
            double most = -1.0;
            for (const auto& [center, size] : spheres) {
                const DVec3 d = DVec3(s.position) - center;
                if (std::abs(glm::length(d) - 0.5 * size) < 0.05)
                    most = std::max(most, glm::dot(DVec3(s.normal), d));
            }
            EXPECT_GT(most, 0.0) << i;
        }
    }
}

// Two sides of a leaf, each of its own: neither ends where the other is.
TEST(Splats, sheetsBackToBackAreFewSplats) {
    TestScene scene;
    scene.add(makePrimitive("plane", 200, Vec3(0.5f)), Affine());
    Affine turned;
    turned.linear = DMat3(1, 0, 0, 0, -1, 0, 0, 0, -1);
    scene.add(makePrimitive("plane", 200, Vec3(0.5f)), turned);
    scene.build();
    for (Material& material : scene.scene.materials) material.double_sided = false;
    SplatOptions options;
    options.points = 5000;
    SplatReport report;
    const SurfelModel model = build(scene.scene, options, report);
    EXPECT_GE(report.splats, 2u);
    EXPECT_LE(report.splats, 40u);
}

// A disc as thin as the tolerance, soon: its other side is no reason for smaller splats, nor is a
// tolerance larger than what was looked at.
TEST(Splats, areNoMoreWhereTheToleranceIsLarger) {
    std::vector<std::string> lines;
    for (int i = 0; i < 8000; ++i) {
        const double z = 1.0 - (2.0 * i + 1.0) / 8000, a = 2.399963 * i, r = std::sqrt(1 - z * z);
        lines.push_back(std::to_string(r * std::cos(a)) + " " + std::to_string(0.15 * z) + " " +
                        std::to_string(r * std::sin(a)));
    }
    const Scene scene = cloudScene(lines, "");
    uint64_t before = 1000;
    for (const double tolerance : {0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 50.0}) {
        SplatOptions options;
        options.tolerance = tolerance;
        SplatReport report;
        const SurfelModel model = build(scene, options, report);
        EXPECT_LE(report.splats, before + before / 20 + 2) << tolerance;
        EXPECT_LE(report.largest_distance, report.tolerance + longestStep(model));
        before = report.splats;
    }
    EXPECT_LE(before, 60u);
}

// What is small and finely sampled lies within a few points' distance on what is large.
TEST(Splats, smallThingsOnALargePlaneAreFew) {
    TestScene scene;
    scene.add(makePrimitive("plane", 2, Vec3(0.5f)), placed(DVec3(0.0), DVec3(40.0)));
    for (int i = 0; i < 4; ++i) {
        scene.add(makePrimitive("torus", 2000, Vec3(0.5f)),
                  placed(DVec3(1.5 * i, 0.15, 0), DVec3(0.5)));
    }
    SplatOptions options;
    options.points = 20000;
    SplatReport report;
    build(scene.build(), options, report);
    EXPECT_EQ(report.points, 100000u);
    EXPECT_LE(report.splats, 300u);
}

TEST(Splats, shineAsTheirMaterialsDo) {
    TestScene scene;
    scene.add(makePrimitive("sphere", 200, Vec3(0.5f)), Affine());
    Material& material = scene.scene.materials[0];
    material.emissive = Vec3(3, 2, 1);
    material.specular_weight = 0.25f;
    material.roughness = 0.3f;
    SplatOptions options;
    options.points = 1000;
    SplatReport report;
    const SurfelModel model = build(scene.build(), options, report);
    ASSERT_EQ(model.finishes.size(), 1u);
    EXPECT_EQ(model.finishes[0].material.emissive, Vec3(3, 2, 1));
    EXPECT_EQ(model.finishes[0].material.specular_weight, 0.25f);
    EXPECT_EQ(model.finishes[0].material.roughness, 0.3f);
}

// More materials than a model has finishes: alike ones share one.
TEST(Splats, ofVeryManyMaterialsAlikeOnesAreJoined) {
    std::vector<Material> materials(1000);
    std::map<uint32_t, uint8_t> index_of, few;
    for (uint32_t i = 0; i < 1000; ++i) {
        Material& m = materials[i];
        m.double_sided = i % 2;
        m.unlit = i % 7 == 0;
        m.roughness = float(i % 100) / 100.0f;
        m.emissive = Vec3(i % 5 == 0 ? 4.0f : 0.0f);
        index_of[finishKey(materials, i, plainFinish(m))] = 0;
        // 200 of them, most with numbers above 255.
        if (i >= 800) few[finishKey(materials, i, plainFinish(m))] = 0;
    }
    ASSERT_EQ(index_of.size(), 1000u);
    const std::vector<float> width(1000, 1.0f);
    const std::vector<SurfelFinish> finishes = makeFinishes(materials, width, index_of);
    EXPECT_LE(finishes.size(), 256u);
    EXPECT_GE(finishes.size(), 20u);
    EXPECT_EQ(makeFinishes(materials, width, few).size(), 200u);
    for (uint32_t i = 0; i < 1000; ++i) {
        const uint32_t key = finishKey(materials, i, plainFinish(materials[i]));
        const Material& m = finishes[index_of.at(key)].material;
        EXPECT_EQ(m.double_sided, materials[i].double_sided) << i;
        EXPECT_EQ(m.unlit, materials[i].unlit) << i;
        EXPECT_NEAR(m.roughness, materials[i].roughness, 0.1f) << i;
        EXPECT_EQ(m.emissive, materials[i].emissive) << i;
        if (i < 800) continue;
        EXPECT_EQ(few.at(key), i - 800);
    }
}

TEST(Splats, tooManyPointsAreRefusedBeforeTheyAreTaken) {
    TestScene scene;
    scene.add(makePrimitive("box", 12, Vec3(0.5f)), Affine());
    for (int i = 0; i < 999; ++i) scene.root.instances.add(ChildRef::mesh(0), Affine());
    scene.build();
    const auto errorOf = [&](int points, uint64_t limit_mb) {
        SplatOptions options;
        options.points = points;
        options.memory_limit_mb = limit_mb;
        SplatReport report;
        try {
            build(scene.scene, options, report);
        } catch (const Error& error) {
            return error.code();
        }
        return ErrorCode::kInternal;
    };
    EXPECT_EQ(errorOf(200000, 500), ErrorCode::kUnsupported);  // 2 * 10^8
    EXPECT_EQ(errorOf(20000, 500), ErrorCode::kOutOfMemory);
}

TEST(Splats, whatIsThereTwiceCountsOnce) {
    TestScene once, twice;
    once.add(makePrimitive("torus", 200, Vec3(0.5f)), Affine());
    twice.add(makePrimitive("torus", 200, Vec3(0.5f)), Affine());
    twice.root.instances.add(ChildRef::mesh(0), Affine());
    SplatOptions options;
    options.points = 2000;
    SplatReport of_once, of_twice;
    build(once.build(), options, of_once);
    build(twice.build(), options, of_twice);
    EXPECT_EQ(of_once.same_places, 0u);
    EXPECT_EQ(of_twice.same_places, 2000u);
    EXPECT_EQ(of_twice.points, 2000u);
    EXPECT_EQ(of_twice.splats, of_once.splats);
}

TEST(Splats, oddCloudsAreHandled) {
    SplatReport report;
    // On a line, all at one place, a single one, and a few.
    std::vector<std::string> line, same;
    for (int i = 0; i < 200; ++i) line.push_back(std::to_string(i) + " 0 0");
    for (int i = 0; i < 200; ++i) same.push_back("1 2 3");
    for (const auto& lines : {line, same, std::vector<std::string>{"1 2 3"},
                              std::vector<std::string>{"0 0 0", "1 0 0", "0 0 1"}}) {
        const SurfelModel model = build(cloudScene(lines, ""), SplatOptions(), report);
        EXPECT_GE(model.levels[0].size(), 1u);
        checkSurfelModel(model, "odd");
    }
    try {
        build(cloudScene({"nan 0 0"}, ""), SplatOptions(), report);
        ADD_FAILURE() << "a cloud without points was taken";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kInvalidScene);
    }
}

}  // namespace
}  // namespace stipple
