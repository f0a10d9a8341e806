// SPDX-License-Identifier: Apache-2.0
// Prebuilt models: what is packed comes back, and files that are damaged in any way are refused.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/io/surfel_file.h>

#include <cstring>

namespace stipple {
namespace {

std::vector<Surfel> ball(int n) {
    std::vector<Surfel> surfels;
    Rng rng{7};
    for (int i = 0; i < n; ++i) {
        const float z = float(rng.uniform(-1, 1)), a = float(rng.uniform(0, 2 * kPi));
        const float r = std::sqrt(1 - z * z);
        const Vec3 p(r * std::cos(a), r * std::sin(a), z);
        surfels.push_back({p * 2.0f + Vec3(5, 0, 0), p, Vec3(0.2f, 0.5f, 0.8f), uint8_t(i % 2),
                           1.0f + float(i % 5)});
    }
    return surfels;
}

SurfelModel ballModel(bool with_radii) {
    SurfelModel model;
    model.kind = with_radii ? "splats" : "point-blocks";
    model.source = "ball.ply";
    model.bounds = {Vec3(3, -2, -2), Vec3(7, 2, 2)};
    model.area = 16 * kPi;
    model.finishes.resize(2);
    model.levels.push_back(packSurfels(ball(5000), model.finishes, 0.05f, with_radii));
    model.levels.push_back(packSurfels(ball(1000), model.finishes, 0.1f, with_radii));
    return model;
}

TEST(SurfelModel, packedSurfelsComeBackWithinTheirSteps) {
    const SurfelModel model = ballModel(true);
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

// Nothing of a block may be seen from where its cone says so.
TEST(SurfelModel, conesHideWhatFacesAway) {
    const SurfelModel model = ballModel(false);
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

TEST(SurfelFile, comesBackAsItWas) {
    const SurfelModel model = ballModel(true);
    const std::string text = surfelFileText(model);
    MemoryBudget budget(0);
    const SurfelModel read = parseSurfelFile(text, budget, "ball.stipple");
    EXPECT_EQ(surfelFileText(read), text);
    EXPECT_EQ(read.source, "ball.ply");
    EXPECT_EQ(read.levels[1].position, model.levels[1].position);
}

std::string errorOf(const std::string& text) {
    MemoryBudget budget(0);
    try {
        parseSurfelFile(text, budget, "m.stipple");
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

TEST(SurfelFile, refusesWhatIsDamaged) {
    SurfelModel small = ballModel(false);
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
    // Behind a checksum that fits anything may stand: an error or a model, but no crash.
    for (int i = 0; i < 2000; ++i) {
        std::string forged = text;
        for (int k = 0; k < 3; ++k)
            forged[32 + size_t(rng.uniform(0, double(i % 2 ? 400 : text.size() - 32)))] =
                char(rng.next());
        errorOf(withChecksum(forged));
        errorOf(
            withChecksum(forged.substr(0, 32 + size_t(rng.uniform(0, double(text.size() - 32))))));
    }
    std::string newer = text;
    newer[8] = 9;
    EXPECT_NE(errorOf(newer).find("has version 9"), std::string::npos);
}

}  // namespace
}  // namespace stipple
