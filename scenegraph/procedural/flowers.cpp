// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/sheet.h>

#include <algorithm>

namespace stipple {

namespace {

struct FlowerKind {
    const char* name;
    double height;  // metres
    int petals;
    float head;          // metres, radius of an open flower
    float petal_aspect;  // width / length
    float cup;           // 0: flat, 1: petals stand up
    int bells;           // 0: one head on top; else so many small ones hang along the stem
    Vec3 petal, center;  // linear
};
constexpr int kMostPetals = 14;
const FlowerKind kFlowers[] = {
    {"daisy", 0.4, 14, 0.034f, 0.36f, 0.1f, 0, Vec3(0.86f, 0.86f, 0.82f), Vec3(0.8f, 0.5f, 0.03f)},
    {"buttercup", 0.45, 5, 0.026f, 0.95f, 0.55f, 0, Vec3(0.9f, 0.66f, 0.02f),
     Vec3(0.6f, 0.5f, 0.03f)},
    {"poppy", 0.55, 5, 0.05f, 1.15f, 0.6f, 0, Vec3(0.72f, 0.045f, 0.015f),
     Vec3(0.03f, 0.03f, 0.03f)},
    {"bluebell", 0.35, 4, 0.02f, 0.6f, -0.8f, 7, Vec3(0.2f, 0.16f, 0.62f),
     Vec3(0.2f, 0.16f, 0.6f)}};

void appendHead(SheetMesh& sheet, Rng& rng, const FlowerKind& kind, const Vec3& at,
                const Vec3& facing, float scale) {
    Vec3 side, third;
    completeFrame(facing, side, third);
    const float turn = uniform(rng, 0.0, 2.0 * kPi), value = uniform(rng, 0.8, 1.08);
    const float length = kind.head * scale;
    const int petals = std::min(kind.petals, kMostPetals);
    for (int i = 0; i < petals; ++i) {
        const float a = turn + float(2.0 * kPi) * float(i) / float(petals);
        const Vec3 out = side * std::cos(a) + third * std::sin(a);
        const Vec3 tangent = third * std::cos(a) - side * std::sin(a);
        const Vec3 tip = at + (out + facing * kind.cup) * length;
        sheet.leaf(at + out * (0.1f * length), tip, tangent * (length * kind.petal_aspect),
                   glm::normalize(facing + Vec3(0, 0.7f, 0) + out * 0.3f), kind.petal * value);
    }
    if (kind.bells > 0) return;
    const float r = 0.3f * length;
    const Vec3 top = at + facing * (0.12f * length);
    sheet.leaf(top - side * r, top + side * r, third * (2.0f * r), facing, kind.center);
}

}  // namespace

std::vector<std::string> flowerSpecies() {
    std::vector<std::string> names;
    for (const FlowerKind& kind : kFlowers) names.push_back(kind.name);
    return names;
}

GeneratedMesh makeFlowers(const FlowersParams& params) {
    const auto kind = std::find_if(std::begin(kFlowers), std::end(kFlowers),
                                   [&](const FlowerKind& k) { return params.species == k.name; });
    if (kind == std::end(kFlowers)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "unknown flower species '" + params.species +
                        "' (daisy, buttercup, poppy or bluebell)");
    }
    if (params.stems < 1 || params.stems > 200000)
        throw Error(ErrorCode::kInvalidArgument, "", "flowers' stems must be in 1..200000");
    if (!((params.height == 0.0 || (params.height >= 1e-3 && params.height <= 1e3)) &&
          params.radius >= 0.0 && params.radius <= 1e3)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "flowers' height must be 0 (typical) or in 0.001..1000 and their radius in "
                    "0..1000 metres");
    }
    Rng rng{hashCombine(params.seed, 0xf10)};
    SheetMesh sheet;
    const float height = float(params.height > 0.0 ? params.height : kind->height);
    const float scale = height / float(kind->height);
    for (int i = 0; i < params.stems; ++i) {
        const float r = float(params.radius) * std::sqrt(uniform(rng, 0.0, 1.0));
        const float a = uniform(rng, 0.0, 2.0 * kPi);
        const Vec3 root(r * std::cos(a), -0.02f * height, r * std::sin(a));
        const Vec3 along = nearlyUp(rng, 0.35);
        const float length = height * (i == 0 ? 1.0f : uniform(rng, 0.55, 0.98));
        const Vec3 top = root + along * length;
        const Vec3 green = Vec3(0.13f, 0.2f, 0.045f) * uniform(rng, 0.8, 1.1);
        const Vec3 lit = glm::normalize(Vec3(0, 1, 0) + randomUnit(rng) * 0.4f);
        const float wide = 0.012f * height;
        Vec3 side, third;
        completeFrame(along, side, third);
        sheet.spike(root, side * wide, top, lit, green);
        sheet.spike(root, third * wide, top, lit, green);
        for (int leaf = 0; leaf < 3; ++leaf) {
            const Vec3 base = root + along * (length * uniform(rng, 0.02, 0.3));
            const Vec3 out = offAxis(along, uniform(rng, 0.5, 1.1), uniform(rng, 0.0, 2.0 * kPi));
            const Vec3 tip = base + out * (length * uniform(rng, 0.25, 0.45));
            const Vec3 across = glm::normalize(glm::cross(out, Vec3(0, 1, 0)) + Vec3(1e-5f, 0, 0));
            sheet.leaf(base, tip, across * (0.05f * length), lit, green * 1.1f);
        }
        if (kind->bells == 0) {
            appendHead(sheet, rng, *kind, top,
                       glm::normalize(along + Vec3(0.3f, 0.2f, 0.25f) + randomUnit(rng) * 0.35f),
                       scale * uniform(rng, 0.75, 1.15));
        }
        const float bow = uniform(rng, 0.0, 2.0 * kPi);
        for (int bell = 0; bell < kind->bells; ++bell) {
            const float t = 1.0f - 0.07f * float(bell);
            const float around = bow + uniform(rng, -0.8, 0.8);
            const Vec3 out(std::cos(around), -0.9f, std::sin(around));
            appendHead(sheet, rng, *kind, root + along * (length * t) + out * (0.012f * scale),
                       glm::normalize(out * Vec3(-1, -1, -1)), scale * uniform(rng, 0.8, 1.2));
        }
    }
    return std::move(sheet).finish(kind->name, 0.0);
}

}  // namespace stipple
