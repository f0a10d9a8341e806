// SPDX-License-Identifier: Apache-2.0
// Cones of normals against every normal, place and eye that they stand for.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/normal_cone.h>

namespace stipple {
namespace {

// Within `spread` radians of the axis, or opposite.
Vec3 directionNear(const Vec3& axis, double spread, uint64_t key) {
    Vec3 u, v;
    tangents(axis, u, v);
    const double turn = 2.0 * kPi * uniformDouble(hashCombine(key, uint64_t(1)));
    const double angle = spread * std::sqrt(uniformDouble(hashCombine(key, uint64_t(2))));
    const Vec3 n = axis * float(std::cos(angle)) +
                   (u * float(std::cos(turn)) + v * float(std::sin(turn))) * float(std::sin(angle));
    return hashCombine(key, uint64_t(3)) & 1 ? n : -n;
}

DVec3 anywhere(uint64_t key) {
    return DVec3(uniformDouble(hashCombine(key, uint64_t(4))),
                 uniformDouble(hashCombine(key, uint64_t(5))),
                 uniformDouble(hashCombine(key, uint64_t(6)))) *
               2.0 -
           1.0;
}

NormalCone coneOf(const std::vector<Vec3>& normals) {
    std::vector<WeightedCone> parts;
    for (const Vec3& n : normals) parts.push_back({{n, 1.0f}, 1.0});
    return surroundingCone(parts);
}

TEST(NormalCone, holdsEveryNormalOnEitherSide) {
    for (uint64_t round = 0; round < 200; ++round) {
        const Vec3 axis = glm::normalize(Vec3(anywhere(round)));
        const double spread = 1.2 * uniformDouble(hashCombine(round, uint64_t(7)));
        std::vector<Vec3> normals;
        for (uint64_t i = 0; i < 40; ++i)
            normals.push_back(directionNear(axis, spread, hashCombine(round, i, uint64_t(8))));
        const NormalCone cone = coneOf(normals);
        for (const Vec3& n : normals)
            EXPECT_GE(std::abs(glm::dot(n, cone.axis)), cone.cos_spread - 1e-4f);
        // And hardly more: the axis is at most as far from the true one as the normals are.
        EXPECT_GE(cone.cos_spread, float(std::cos(std::min(2.0 * spread, 0.5 * kPi))) - 1e-3f);
    }
}

TEST(NormalCone, conesOfConesHoldTheirNormals) {
    for (uint64_t round = 0; round < 200; ++round) {
        const Vec3 axis = glm::normalize(Vec3(anywhere(round)));
        std::vector<WeightedCone> parts;
        std::vector<Vec3> normals;
        for (uint64_t part = 0; part < 5; ++part) {
            const Vec3 middle = directionNear(axis, 0.4, hashCombine(round, part));
            std::vector<Vec3> some;
            for (uint64_t i = 0; i < 8; ++i)
                some.push_back(directionNear(middle, 0.2, hashCombine(round, part, i)));
            parts.push_back({coneOf(some), 1.0 + double(part)});
            normals.insert(normals.end(), some.begin(), some.end());
        }
        const NormalCone cone = surroundingCone(parts);
        EXPECT_GT(cone.cos_spread, 0.0f);
        for (const Vec3& n : normals)
            EXPECT_GE(std::abs(glm::dot(n, cone.axis)), cone.cos_spread - 1e-4f);
    }
}

TEST(NormalCone, boundsTheCosineFromEveryPlaceOfTheBox) {
    for (uint64_t round = 0; round < 2000; ++round) {
        const Vec3 axis = glm::normalize(Vec3(anywhere(round)));
        const double spread = 0.5 * uniformDouble(hashCombine(round, uint64_t(7)));
        const NormalCone cone{axis, float(std::cos(spread))};
        Box3 box;
        box.extend(Vec3(anywhere(hashCombine(round, uint64_t(9)))));
        box.extend(Vec3(anywhere(hashCombine(round, uint64_t(10)))));
        const DVec3 eye = anywhere(hashCombine(round, uint64_t(11))) * 12.0;
        const bool orthographic = round % 2 == 0;
        const float bound = largestCosine(cone, box, eye, orthographic);
        EXPECT_LE(bound, 1.0f);
        for (uint64_t i = 0; i < 20; ++i) {
            const Vec3 n = directionNear(axis, spread, hashCombine(round, i));
            const Vec3 at = Vec3(anywhere(hashCombine(round, i, uint64_t(12)))) * 0.5f + 0.5f;
            const Vec3 to_eye =
                orthographic ? Vec3(eye) : Vec3(eye) - (box.min + at * box.extent());
            EXPECT_LE(std::abs(glm::dot(n, glm::normalize(to_eye))), bound);
        }
    }
}

TEST(NormalCone, isTightForAFarPlane) {
    const NormalCone flat{Vec3(0.0f, 1.0f, 0.0f), 1.0f};
    const Box3 box{Vec3(-1.0f, 0.0f, -1.0f), Vec3(1.0f, 0.0f, 1.0f)};
    for (const double elevation : {5.0, 20.0, 45.0, 80.0}) {
        const double a = radians(elevation);
        const DVec3 eye = DVec3(std::cos(a), std::sin(a), 0.0) * 200.0;
        EXPECT_NEAR(largestCosine(flat, box, eye, false), std::sin(a), 0.02);
        EXPECT_NEAR(largestCosine(flat, box, eye, true), std::sin(a), 0.02);
    }
    EXPECT_EQ(largestCosine(flat, box, DVec3(0.5, 0.1, 0.0), false), 1.0f);  // the eye is near
    EXPECT_EQ(largestCosine(NormalCone(), box, DVec3(9.0, 0.0, 0.0), false), 1.0f);
    EXPECT_EQ(surroundingCone({}).cos_spread, 0.0f);
}

}  // namespace
}  // namespace stipple
