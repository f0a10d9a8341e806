// SPDX-License-Identifier: Apache-2.0
// Prebuilt models: what is packed comes back, and files that are damaged in any way are refused.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <render/renderer.h>
#include <scenegraph/disc_planes.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/surfel_file.h>

#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

namespace stipple {
namespace {

std::vector<Surfel> ball(int n) {
    std::vector<Surfel> surfels;
    Rng rng{7};
    for (int i = 0; i < n; ++i) {
        const float z = float(rng.uniform(-1, 1)), a = float(rng.uniform(0, 2 * kPi));
        const float r = std::sqrt(1 - z * z);
        const Vec3 p(r * std::cos(a), r * std::sin(a), z);
        Surfel s = {p * 2.0f + Vec3(5, 0, 0), p, Vec3(0.2f, 0.5f, 0.8f), uint8_t(i % 2),
                    1.0f + float(i % 5)};
        Vec3 u, v;
        tangents(p, u, v);
        s.along = u * std::cos(a * 3.0f) + v * std::sin(a * 3.0f);
        s.ratio = 0.25f + 0.15f * float(i % 6);
        s.shading_normal = p;
        s.bend = Vec3(0.5f, 0.25f, -0.125f);
        s.n_cuts = i % (kMostDiscCuts + 1);
        for (int c = 0; c < s.n_cuts; ++c)
            s.cuts[size_t(c)] = Vec3(std::cos(a + float(c)), std::sin(a + float(c)), 0.3f);
        surfels.push_back(s);
    }
    return surfels;
}

SurfelModel ballModel(SurfelDiscs discs) {
    SurfelModel model;
    model.kind = discs == SurfelDiscs::kAlike ? "point-blocks" : "splats";
    model.source = "ball.ply";
    model.bounds = {Vec3(3, -2, -2), Vec3(7, 2, 2)};
    model.area = 16 * kPi;
    model.finishes.resize(2);
    model.levels.push_back(packSurfels(ball(5000), model.finishes, 0.05f, discs));
    model.levels.push_back(packSurfels(ball(1000), model.finishes, 0.1f, discs));
    return model;
}

TEST(SurfelModel, packedSurfelsComeBackWithinTheirSteps) {
    const SurfelModel model = ballModel(SurfelDiscs::kRadii);
    const SurfelLevel& level = model.levels[0];
    ASSERT_EQ(level.size(), 5000u);
    size_t count = 0;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i, ++count) {
            const Surfel s = unpackSurfel(level, block, i);
            EXPECT_NEAR(glm::length(s.position - Vec3(5, 0, 0)), 2.0f, 2e-3f);
            EXPECT_GT(glm::dot(s.normal, (s.position - Vec3(5, 0, 0)) / 2.0f),
                      0.9993f);  // 8 bits an axis: 2 degrees
            EXPECT_NEAR(s.albedo.g, 0.5f, 0.01f);
            // Not smaller than asked for, and by less than an eighth of an octave larger.
            const float share = s.radius_share / std::round(s.radius_share - 0.04f);
            EXPECT_GE(share, 0.999f);
            EXPECT_LE(share, 1.1f);
        }
    }
    EXPECT_EQ(count, 5000u);
    EXPECT_GT(double(level.size()) / double(level.blocks.size()), 28.0);  // blocks are well filled
}

// Few surfels each, so that blocks would go on from one to the next.
TEST(SurfelModel, whatLiesFarApartKeepsItsPlaces) {
    for (const SurfelDiscs discs : {SurfelDiscs::kAlike, SurfelDiscs::kShapes}) {
        std::vector<Surfel> surfels;
        Rng rng{9};
        for (int object = 0; object < 40; ++object) {
            const Vec3 at(float(rng.uniform(-500, 500)), 0.0f, float(rng.uniform(-500, 500)));
            for (Surfel& s : ball(5)) {
                s.position = at + s.normal * 0.1f;
                surfels.push_back(s);
            }
        }
        constexpr float kSpacing = 0.05f;
        std::vector<uint32_t> place;
        const SurfelLevel level =
            packSurfels(surfels, std::vector<SurfelFinish>(2), kSpacing, discs, &place);
        std::vector<Surfel> kept;
        for (const SurfelBlock& block : level.blocks) {
            for (uint32_t i = block.first; i < block.first + block.count; ++i)
                kept.push_back(unpackSurfel(level, block, i));
        }
        ASSERT_EQ(place.size(), surfels.size());
        for (size_t i = 0; i < surfels.size(); ++i)
            EXPECT_LT(glm::length(kept[place[i]].position - surfels[i].position), 0.03f * kSpacing);
    }
}

// Points a spacing apart on a plane, or on a line in it, with one shading normal that is not its.
std::vector<float> cosinesToPlane(const Vec3& plane, const Vec3& shading, int columns) {
    Vec3 u, v;
    tangents(plane, u, v);
    std::vector<Surfel> surfels;
    Rng rng{3};
    for (int i = 0; i < 24 * columns; ++i) {
        Surfel s;
        s.position = u * (float(i / columns) + float(rng.uniform(-0.2, 0.2))) +
                     v * (float(i % columns) + float(rng.uniform(-0.2, 0.2)));
        s.normal = shading;
        surfels.push_back(s);
    }
    const SurfelLevel level =
        packSurfels(surfels, std::vector<SurfelFinish>(1), 1.0f, SurfelDiscs::kAlike);
    std::vector<float> cosines;
    std::array<Vec3, kBlockSurfels> normals;
    for (const SurfelBlock& block : level.blocks) {
        std::vector<Surfel> of_block;
        for (uint32_t i = block.first; i < block.first + block.count; ++i)
            of_block.push_back(unpackSurfel(level, block, i));
        discPlanes(level.spacing, of_block.data(), int(block.count), normals.data());
        for (uint32_t i = 0; i < block.count; ++i) {
            EXPECT_NEAR(glm::length(normals[i]), 1.0f, 1e-4f);
            cosines.push_back(glm::dot(normals[i], plane));
        }
    }
    return cosines;
}

TEST(SurfelModel, discsLieInTheSurfaceWhateverItsShadingNormal) {
    const Vec3 plane = glm::normalize(Vec3(0.3f, -0.5f, 0.8f));
    Vec3 aside, unused;
    tangents(plane, aside, unused);
    for (const float tilt : {0.0f, 0.7f, 1.4f, -1.0f}) {
        const Vec3 shading = plane * std::cos(tilt) + aside * std::sin(tilt);
        const std::vector<float> of_plane = cosinesToPlane(plane, shading, 24);
        const auto in_plane =
            std::count_if(of_plane.begin(), of_plane.end(), [](float c) { return c > 0.999f; });
        EXPECT_GT(in_plane, std::ptrdiff_t(of_plane.size()) * 95 / 100) << tilt;
        // No more can be said of a line.
        for (const float c : cosinesToPlane(plane, shading, 1))
            EXPECT_NEAR(c, std::cos(tilt), 0.05f);
    }
}

// Nothing of a block may be seen from where its cone says so.
TEST(SurfelModel, conesHideWhatFacesAway) {
    const SurfelModel model = ballModel(SurfelDiscs::kAlike);
    Rng rng{3};
    int hidden = 0, tried = 0;
    for (const SurfelBlock& block : model.levels[0].blocks) {
        for (int k = 0; k < 50; ++k, ++tried) {
            const Vec3 x(float(rng.uniform(-20, 30)), float(rng.uniform(-20, 20)),
                         float(rng.uniform(-20, 20)));
            const Vec3 d = x - block.cone_apex;
            if (!(block.cone_sine < 1.0f) ||
                glm::dot(d, block.cone_axis) >= -block.cone_sine * glm::length(d))
                continue;
            ++hidden;
            for (uint32_t i = block.first; i < block.first + block.count; ++i) {
                const Surfel s = unpackSurfel(model.levels[0], block, i);
                EXPECT_LT(glm::dot(x - s.position, s.normal), 0.02f);
            }
        }
    }
    EXPECT_GT(hidden, tried / 5);
}

// Whatever lies outside of a block's ball is left out before it is looked at.
TEST(SurfelModel, ballsHoldWhatIsDrawnOfBlocks) {
    for (const SurfelDiscs discs :
         {SurfelDiscs::kAlike, SurfelDiscs::kRadii, SurfelDiscs::kShapes}) {
        SurfelModel model = ballModel(discs);
        measureDiscs(model);
        for (const SurfelLevel& level : model.levels) {
            const SurfelBalls& balls = level.balls;
            ASSERT_EQ(balls.x.size(), level.blocks.size());
            for (size_t b = 0; b < level.blocks.size(); ++b) {
                const SurfelBlock& block = level.blocks[b];
                const Vec3 middle =
                    model.bounds.center() + Vec3(balls.x[b], balls.y[b], balls.z[b]);
                std::array<Vec3, kMostDiscCorners> corners;
                for (uint32_t i = block.first; i < block.first + block.count; ++i) {
                    const Surfel s = unpackSurfel(level, block, i);
                    const int n = discPolygon(
                        level, s, model.discSide() * level.spacing * s.radius_share, corners);
                    for (int c = 0; c < n; ++c) {
                        EXPECT_LE(glm::distance(middle, s.position + corners[size_t(c)]),
                                  balls.radius[b] * 1.0001f);
                    }
                    if (discs != SurfelDiscs::kAlike) continue;
                    // The end of ewa's kernel, of a standard deviation of half a spacing.
                    const float reach = 0.5f * std::sqrt(8.0f) * level.spacing;
                    EXPECT_LE(glm::distance(middle, s.position) + reach, balls.radius[b]);
                    for (int a = 0; a < 3 && &level == &model.levels[0]; ++a) {
                        EXPECT_LE(model.drawn_bounds.min[a], s.position[a] - reach);
                        EXPECT_GE(model.drawn_bounds.max[a], s.position[a] + reach);
                    }
                }
            }
        }
    }
}

TEST(SurfelModel, maskDirectionsCoverTheSphereEvenly) {
    std::vector<int> hits(kMaskDirections, 0);
    Rng rng{5};
    for (int i = 0; i < 20000; ++i) {
        const float z = float(rng.uniform(-1, 1)), a = float(rng.uniform(0, 2 * kPi));
        const float r = std::sqrt(1 - z * z);
        const Vec3 d(r * std::cos(a), r * std::sin(a), z);
        const int m = maskDirectionIndex(d);
        ++hits[size_t(m)];
        EXPECT_GT(glm::dot(d, maskDirectionOf(m)), 0.94f);
    }
    for (const int n : hits) EXPECT_GT(n, 60);
    for (int m = 0; m < kMaskDirections; ++m) EXPECT_EQ(maskDirectionIndex(maskDirectionOf(m)), m);
}

TEST(SurfelModel, shapesComeBackWithinTheirSteps) {
    SurfelModel model = ballModel(SurfelDiscs::kShapes);
    const SurfelLevel& level = model.levels[0];
    ASSERT_EQ(level.shapes.size(), 5000u);
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const Vec3 p = glm::normalize(s.position - Vec3(5, 0, 0));
            EXPECT_GT(glm::dot(s.normal, p), 0.99999f);
            EXPECT_NEAR(glm::dot(s.normal, s.along), 0.0f, 1e-5f);
            // The angle about z, as above, says the way of the long half axis and of the cuts.
            const float a = std::atan2(p.y, p.x);
            Vec3 u, v;
            tangents(s.normal, u, v);
            const Vec3 along = u * std::cos(a * 3.0f) + v * std::sin(a * 3.0f);
            if (std::hypot(p.x, p.y) > 0.1f && std::abs(p.z) > 0.01f) {
                EXPECT_GT(glm::dot(along, s.along), 0.99f);
            }
            for (int c = 0; c < s.n_cuts; ++c) EXPECT_NEAR(s.cuts[size_t(c)].z, 0.3f, 1e-4f);
            // At the ends of the half axes, and beyond them.
            const Vec3 across = glm::cross(s.normal, s.along);
            const float long_axis = level.spacing * s.radius_share / std::sqrt(s.ratio);
            for (const float reach : {1.0f, 3.0f}) {
                const auto at = [&](const Vec3& offset) {
                    return bentNormal(level, s, kSidePerRadius, offset * (reach * long_axis));
                };
                const Vec3 n = s.shading_normal, to = s.along, by = across * s.ratio;
                const Vec3 far_along = glm::normalize(n + 0.5f * to - 0.125f * across),
                           far_across =
                               glm::normalize(n + s.ratio * (0.25f * across - 0.125f * s.along));
                EXPECT_LT(glm::length(at(to) - far_along), 0.01f);
                EXPECT_LT(glm::length(at(by) - far_across), 0.01f);
            }
            EXPECT_LT(glm::length(bentNormal(level, s, kSidePerRadius, Vec3(0)) - p), 0.04f);
        }
    }
}

TEST(SurfelModel, polygonsEnclosePartsOfEllipses) {
    const SurfelModel model = ballModel(SurfelDiscs::kShapes);
    const SurfelLevel& level = model.levels[0];
    std::array<Vec3, kMostDiscCorners> corners;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const int n = discPolygon(level, s, kSidePerRadius, corners);
            ASSERT_GE(n, 3);
            const float long_axis = 1.0f / std::sqrt(s.ratio);
            const Vec3 across = glm::cross(s.normal, s.along);
            for (int k = 0; k < 40; ++k) {
                const float t = float(k) * 0.157f;
                const Vec2 p(std::cos(t) * long_axis, std::sin(t) * long_axis * s.ratio);
                bool is_kept = true;
                for (int c = 0; c < s.n_cuts; ++c) {
                    const Vec3& cut = s.cuts[size_t(c)];
                    const float beyond = cut.x * p.x + cut.y * p.y - cut.z * long_axis;
                    is_kept = is_kept && beyond <= 0.0f;
                }
                float farthest = -kInfinity;  // outside of an edge
                for (int c = 0; c < n; ++c) {
                    const Vec3 &from = corners[size_t(c)], &to = corners[size_t((c + 1) % n)];
                    const Vec3 outwards = glm::cross(to - from, s.normal);
                    if (glm::length(outwards) < 1e-4f) continue;
                    const Vec3 d = s.along * p.x + across * p.y - from;
                    farthest = std::max(farthest, glm::dot(glm::normalize(outwards), d));
                }
                if (is_kept) {
                    EXPECT_LE(farthest, 1e-3f);
                }
            }
        }
    }
}

TEST(SurfelFile, comesBackAsItWas) {
    const SurfelModel model = ballModel(SurfelDiscs::kRadii);
    const std::string text = surfelFileText(model);
    MemoryBudget budget(0);
    const SurfelModel read = parseSurfelFile(text, budget, "ball.stipple");
    EXPECT_EQ(surfelFileText(read), text);
    EXPECT_EQ(read.source, "ball.ply");
    EXPECT_EQ(read.levels[1].position, model.levels[1].position);
    EXPECT_EQ(text[8], 1);
    // Of splats, and of flat ones as older programs wrote them.
    SurfelModel shaped = ballModel(SurfelDiscs::kShapes);
    for (const int version : {4, 3}) {
        const std::string shaped_text = surfelFileText(shaped);
        EXPECT_EQ(shaped_text[8], version);
        EXPECT_EQ(surfelFileText(parseSurfelFile(shaped_text, budget, "ball.stipple")),
                  shaped_text);
        for (SurfelLevel& level : shaped.levels) level.bends.clear();
    }
}

// Small pictures from near and far.
void draw(const Scene& scene, ThreadPool& pool) {
    Renderer renderer(scene, pool);
    for (const double distance : {1.0, 4.0, 1000.0}) {
        FrameRequest request;
        request.camera = lookAt(DVec3(5.0, 0.0, 2.0 + distance), DVec3(5.0, 0.0, 0.0));
        request.settings.width = request.settings.height = 16;
        renderer.render(request);
    }
}

std::string errorOf(const std::string& text, ThreadPool* pool = nullptr) {
    MemoryBudget budget(0);
    try {
        SurfelModel model = parseSurfelFile(text, budget, "m.stipple");
        if (!pool) return "";
        // What passes can be shown.
        Scene scene;
        scene.groups.emplace_back();
        scene.groups[0].instances.add(addSurfelModel(scene, std::move(model), "m.stipple"),
                                      Affine());
        buildScene(scene, *pool);
        draw(scene, *pool);
    } catch (const Error& error) {
        EXPECT_NE(error.code(), ErrorCode::kInternal);
        return error.what();
    }
    return "";
}

// The checksum made to fit, so that what lies behind it is tried, too.
std::string withChecksum(std::string text) {
    constexpr size_t kHeader = 32;
    uint64_t key = text.size() - kHeader;
    for (size_t i = kHeader; i < text.size(); i += 8) {
        uint64_t word = 0;
        std::memcpy(&word, text.data() + i, std::min<size_t>(8, text.size() - i));
        key = hashCombine(key, word);
    }
    std::memcpy(text.data() + 24, &key, 8);
    const uint64_t size = text.size() - kHeader;
    std::memcpy(text.data() + 16, &size, 8);
    return text;
}

class DamagedFile : public testing::TestWithParam<SurfelDiscs> {};

INSTANTIATE_TEST_SUITE_P(SurfelFile, DamagedFile,
                         testing::Values(SurfelDiscs::kAlike, SurfelDiscs::kShapes));

TEST_P(DamagedFile, isRefused) {
    SurfelModel small = ballModel(GetParam());
    small.levels.erase(small.levels.begin());
    const std::string text = surfelFileText(small);
    EXPECT_EQ(withChecksum(text), text);  // as the writer does it
    EXPECT_NE(errorOf("").find("m.stipple: is no model"), std::string::npos);
    EXPECT_NE(errorOf("ply\nformat ascii 1.0\n").find("is no model"), std::string::npos);
    for (size_t n = 0; n < text.size(); n += 97) EXPECT_NE(errorOf(text.substr(0, n)), "") << n;
    Rng rng{11};
    for (int i = 0; i < 300; ++i) {
        std::string flipped = text;
        flipped[size_t(rng.uniform(0, double(text.size())))] ^= char(1 << int(rng.uniform(0, 8)));
        EXPECT_NE(errorOf(flipped), "");
    }
    // Behind a checksum that fits anything may stand: an error or a model that can be drawn.
    ThreadPool pool(2);
    for (int i = 0; i < 2000; ++i) {
        std::string forged = text;
        for (int k = 0; k < 3; ++k)
            forged[32 + size_t(rng.uniform(0, double(i % 2 ? 400 : text.size() - 32)))] =
                char(rng.next());
        errorOf(withChecksum(forged), &pool);
        errorOf(
            withChecksum(forged.substr(0, 32 + size_t(rng.uniform(0, double(text.size() - 32))))));
    }
    std::string newer = text;
    newer[8] = 9;
    EXPECT_NE(errorOf(newer).find("has version 9"), std::string::npos);
}

// What stands for splats are polygons as large as they; memory is reserved for them, and there are
// no more than 40 000.
TEST(SurfelFile, meshThatStandsForSplatsIsWithinTheMemoryLimit) {
    SurfelModel model = ballModel(SurfelDiscs::kShapes);
    model.levels = {packSurfels(ball(60000), model.finishes, 0.05f, SurfelDiscs::kShapes)};
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() /
        ("stipple-stand-in-" + std::to_string(getpid()) + ".stipple");
    std::ofstream(path, std::ios::binary) << surfelFileText(model);
    ThreadPool pool(2);
    Diagnostics diagnostics;
    try {
        loadScene(path.string(), {true, 10, nullptr}, pool, diagnostics);
        ADD_FAILURE() << "it was loaded";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
        EXPECT_NE(std::string(error.what()).find("the mesh that stands for 60000"),
                  std::string::npos);
    }
    const Scene scene = loadScene(path.string(), {true, 60, nullptr}, pool, diagnostics);
    std::filesystem::remove(path);
    EXPECT_LE(scene.meshes[0].triangles.size(), 40000u * 8);
    EXPECT_GE(scene.meshes[0].triangles.size(), 40000u * 2);
}

// They reach messages and the terminal.
TEST(SurfelFile, namesHaveNoControlCharacters) {
    SurfelModel model = ballModel(SurfelDiscs::kAlike);
    model.source = "ball\x1b[31m\n.ply";
    model.finishes[0].material.name = "red\a\r";
    MemoryBudget budget(0);
    const SurfelModel read = parseSurfelFile(surfelFileText(model), budget, "ball.stipple");
    for (const std::string& name : {read.source, read.finishes[0].material.name}) {
        EXPECT_FALSE(name.empty());
        for (const char c : name) EXPECT_GE(c, ' ');
    }
}

// Points know their level as a small number.
TEST(SurfelFile, withMoreLevelsThanBuildersMakeIsRefused) {
    SurfelModel model = ballModel(SurfelDiscs::kAlike);
    model.levels.erase(model.levels.begin());
    const SurfelLevel level =
        packSurfels(ball(3), model.finishes, model.levels[0].spacing, SurfelDiscs::kAlike);
    model.levels.insert(model.levels.end(), kMostSurfelLevels - 1, level);
    ThreadPool pool(2);
    EXPECT_EQ(errorOf(surfelFileText(model), &pool), "");
    for (const size_t more : {size_t(kMostSurfelLevels) + 1, size_t(33000), size_t(65538)}) {
        model.levels.resize(more, level);
        EXPECT_EQ(errorOf(surfelFileText(model), &pool), "m.stipple: has more than 64 levels");
    }
}

}  // namespace
}  // namespace stipple
