// SPDX-License-Identifier: Apache-2.0
// What grows and lies under trees: ferns, fallen leaves.
#include <core/error.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/season.h>
#include <scenegraph/procedural/sheet.h>
#include <scenegraph/procedural/tree_form.h>

namespace stipple {

namespace {

constexpr int kPinnaPairs = 16;

// A frond: a stalk that rises and bends over, with pairs of leaflets, longest at a third of its
// length.
void appendFrond(SheetMesh& sheet, Rng& rng, const Vec3& outward, float length, const Vec3& fresh,
                 const Vec3& old) {
    const float start = uniform(rng, 0.35, 0.75), bend = uniform(rng, 0.7, 1.3);  // off upright
    const float value = uniform(rng, 0.75, 1.0), age = uniform(rng, 0.0, 1.0);
    const Vec3 color = glm::mix(fresh, old, age * age) * value;
    const Vec3 across(outward.z, 0.0f, -outward.x);
    const float sway = uniform(rng, -0.3, 0.3);
    Vec3 p(0.0f);
    constexpr int kSteps = kPinnaPairs + 2;  // the lowest two are bare stalk
    for (int i = 0; i < kSteps; ++i) {
        const float t = float(i) / float(kSteps);
        const float angle = start + bend * t * t;
        const Vec3 along = glm::normalize(outward * std::sin(angle) + Vec3(0, std::cos(angle), 0) +
                                          across * (sway * t));
        const Vec3 next = p + along * (length / float(kSteps));
        Vec3 up = glm::cross(across, along);
        if (up.y < 0.0f) up = -up;
        const float light = 0.45f + 0.55f * t;
        if (i % 2 == 0) {  // the stalk, in pieces of two steps
            const Vec3 end = p + along * (2.0f * length / float(kSteps));
            sheet.spike(p, across * (0.006f * length), end, glm::normalize(up + Vec3(0, 0.5f, 0)),
                        color * Vec3(0.75f, 0.6f, 0.5f) * light);
        }
        if (i >= 2) {
            const float u = float(i - 2) / float(kPinnaPairs);
            const float reach =
                length * 0.27f * std::pow(1.0f - u, 0.75f) * (0.55f + 1.4f * std::min(u, 0.33f)) +
                0.01f * length;
            for (const float hand : {-1.0f, 1.0f}) {
                const Vec3 out = glm::normalize(across * hand + along * uniform(rng, 0.2, 0.45) -
                                                up * uniform(rng, 0.0, 0.3));
                const Vec3 width = along * (0.046f * length * (1.0f - 0.5f * u));
                sheet.leaf(p, p + out * reach, width,
                           glm::normalize(up + Vec3(0, 0.6f, 0) + out * 0.25f),
                           color * light * uniform(rng, 0.9, 1.05));
            }
        }
        p = next;
    }
}

}  // namespace

GeneratedMesh makeFern(const FernParams& params) {
    if (params.fronds < 1 || params.fronds > 10000)
        throw Error(ErrorCode::kInvalidArgument, "", "a fern's fronds must be in 1..10000");
    if (!(params.height >= 1e-3 && params.height <= 1e3)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a fern's height must be in 0.001..1000 metres");
    }
    Vec3 fresh(0.17f, 0.285f, 0.06f), old(0.215f, 0.26f, 0.06f);
    switch (seasonByName(params.season)) {
        case Season::kSpring:
            fresh = Vec3(0.24f, 0.36f, 0.07f);
            break;
        case Season::kSummer:
            break;
        case Season::kAutumn:
            fresh = Vec3(0.33f, 0.24f, 0.07f), old = Vec3(0.3f, 0.15f, 0.05f);
            break;
        case Season::kWinter:
            fresh = Vec3(0.22f, 0.12f, 0.055f), old = Vec3(0.15f, 0.085f, 0.045f);
            break;
    }
    Rng rng{hashCombine(params.seed, 0xfe4)};
    SheetMesh sheet;
    const float turn = uniform(rng, 0.0, 2.0 * kPi);
    for (int i = 0; i < params.fronds; ++i) {
        const float azimuth = turn + kGoldenAngle * float(i) + uniform(rng, -0.3, 0.3);
        appendFrond(sheet, rng, Vec3(std::cos(azimuth), 0.0f, std::sin(azimuth)),
                    uniform(rng, 0.75, 1.1), fresh, old);
    }
    return std::move(sheet).finish("fern", params.height);
}

GeneratedMesh makeLitter(const LitterParams& params) {
    if (params.leaves < 1 || params.leaves > 200000)
        throw Error(ErrorCode::kInvalidArgument, "", "litter's leaves must be in 1..200000");
    if (!(params.radius >= 1e-3 && params.radius <= 1e3)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "litter's radius must be in 0.001..1000 metres");
    }
    const Season season = seasonByName(params.season);
    Rng rng{hashCombine(params.seed, 0x117)};
    SheetMesh sheet;
    const float radius = float(params.radius);
    const float size = 0.09f * std::sqrt(radius);  // metres
    const auto place = [&] {
        const float r = radius * std::sqrt(uniform(rng, 0.0, 1.0)),
                    a = uniform(rng, 0.0, 2.0 * kPi);
        return Vec3(r * std::cos(a), 0.0f, r * std::sin(a));
    };
    const float green = season == Season::kWinter ? 0.03f : season == Season::kAutumn ? 0.1f : 0.3f;
    for (int i = 0; i < params.leaves; ++i) {
        const Vec3 p = place() + Vec3(0, uniform(rng, 0.004, 0.03), 0);
        const float a = uniform(rng, 0.0, 2.0 * kPi);
        const Vec3 along(std::cos(a), uniform(rng, -0.1, 0.3), std::sin(a));
        const Vec3 side = glm::normalize(glm::cross(along, Vec3(0, 1, 0) + randomUnit(rng) * 0.3f));
        const float kind = uniform(rng, 0.0, 1.0), value = uniform(rng, 0.6, 1.1);
        if (kind < green) {  // a small plant: two leaves that rise
            const Vec3 color =
                glm::mix(Vec3(0.14f, 0.24f, 0.05f), Vec3(0.2f, 0.27f, 0.07f), kind / green) * value;
            const Vec3 tip = p + (along + Vec3(0, 0.5f, 0)) * (size * 0.7f);
            sheet.leaf(p, tip, side * (size * 0.5f), Vec3(0, 1, 0), color);
        } else if (kind > 0.95f) {  // a twig
            const float length = size * uniform(rng, 2.0, 5.0);
            sheet.spike(p, side * (0.06f * size), p + Vec3(along.x, 0.1f, along.z) * length,
                        Vec3(0, 1, 0), Vec3(0.16f, 0.115f, 0.08f) * value);
        } else {
            Vec3 color = glm::mix(Vec3(0.2f, 0.115f, 0.055f), Vec3(0.34f, 0.2f, 0.09f),
                                  uniform(rng, 0.0, 1.0));
            if (season == Season::kAutumn)
                color = glm::mix(color, Vec3(0.5f, 0.28f, 0.05f), uniform(rng, 0.0, 1.0));
            const Vec3 normal = glm::normalize(Vec3(0, 1, 0) + randomUnit(rng) * 0.4f);
            sheet.leaf(p, p + along * (size * uniform(rng, 0.7, 1.2)), side * (size * 0.6f), normal,
                       color * value);
        }
    }
    return std::move(sheet).finish("litter", 0.0);
}

}  // namespace stipple
