// SPDX-License-Identifier: Apache-2.0
// Spruce and pine: whorls of branches on a straight stem; flat drooping sprays on the spruce, tufts
// at crooked branch ends on the pine.
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/tree_form.h>

namespace stipple {

namespace {

// Branchlets in the plane of a spruce branch, left and right in turn, shorter towards its tip,
// hanging a little.
void addBranchlets(Skeleton& s, Rng& rng, uint32_t branch, float detail) {
    const Stem parent = s.stems[branch];
    const int count = countFor(rng, (1.5f + 4.2f * parent.length) * std::sqrt(detail), 3);
    for (int i = 0; i < count; ++i) {
        const float at = 0.06f + 0.92f * (float(i) + uniform(rng, 0.1, 0.9)) / float(count);
        const Vec3 forward = s.direction(parent, at);
        const Vec3 side = glm::normalize(glm::cross(forward, Vec3(0, 1, 0)) + Vec3(1e-4f, 0, 0)) *
                          (i % 2 ? 1.0f : -1.0f);
        const float angle = uniform(rng, 0.75, 1.1);
        const Vec3 direction = glm::normalize(forward * std::cos(angle) + side * std::sin(angle) +
                                              Vec3(0, uniform(rng, -0.3, 0.0), 0));
        const float length =
            (0.18f + 0.42f * parent.length * (1.0f - at) * (0.4f + at)) * uniform(rng, 0.75, 1.2);
        const uint32_t stem = growStem(s, rng, s.at(parent, at).position, direction,
                                       {.length = std::min(length, 1.3f),
                                        .segments = 3,
                                        .radius = 0.007f,
                                        .tip_radius = 0.003f,
                                        .wander = 0.06f,
                                        .lift_base = -0.3f,
                                        .lift_tip = -0.6f},
                                       2);
        s.stems[stem].leaf_from = 0.0f;
        s.stems[stem].tint = s.stems[branch].tint;
        s.stems[stem].leaf_size = s.stems[branch].leaf_size;
        s.stems[stem].leaf_density = s.stems[branch].leaf_density;
    }
}

// The outer part of a limb carries upturned branches, their ends tufts of twigs.
void addPineBranches(Skeleton& s, Rng& rng, uint32_t limb, float detail) {
    const float limb_length = s.stems[limb].length;
    const float v = uniform(rng, -1.0, 1.0);
    const Vec3 tint = Vec3(1.0f + 0.1f * v, 1.0f, 1.0f - 0.1f * v) * uniform(rng, 0.85, 1.0);
    const int count = countFor(rng, 2.0f + 2.6f * limb_length, 3);
    float azimuth = uniform(rng, 0.0, 2.0 * kPi);
    for (int i = 0; i < count; ++i) {
        const float at = spreadAlong(rng, i, count, 0.4f);
        azimuth += kGoldenAngle;
        const float length = (0.35f + 0.3f * limb_length * (1.2f - at)) * uniform(rng, 0.8, 1.25);
        const uint32_t branch = branchOff(s, rng, limb, at,
                                          {.angle = uniform(rng, 0.6, 1.1),
                                           .azimuth = azimuth,
                                           .length = length,
                                           .segments = 4,
                                           .radius = 0.008f + 0.012f * length,
                                           .tip_radius = 0.006f,
                                           .taper = 0.8f,
                                           .wander = 0.18f,
                                           .lift_base = 0.6f,
                                           .lift_tip = 1.6f});
        s.stems[branch].leaf_from = 0.6f;
        s.stems[branch].tint = tint;
        const Growth twig{.segments = 2,
                          .radius = 0.009f,
                          .tip_radius = 0.005f,
                          .wander = 0.12f,
                          .lift_base = 0.8f,
                          .lift_tip = 1.6f};
        addTwigs(s, rng, branch,
                 {.count = countFor(rng, (2.0f + 3.5f * length) * std::sqrt(detail), 2),
                  .from = 0.35f,
                  .angle = {0.5, 1.0},
                  .length = {0.2, 0.5},
                  .growth = twig,
                  .leaf_from = 0.35f});
    }
}

}  // namespace

TreeForm growSpruce(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x2a)};
    TreeForm form;
    form.height = 24.0;
    form.tubes = {.root_flare = 0.35f, .relief = 0.04f, .seed = hashCombine(seed, 0x2d)};
    form.evergreen = true;
    form.bark_share = 0.15f;
    form.bark_color = Vec3(0.17f, 0.12f, 0.09f);
    form.leaf_kind = LeafKind::kNeedles;
    form.leaf_color = Vec3(0.1f, 0.165f, 0.055f);
    form.leaf_color_old = Vec3(0.75f, 0.9f, 1.0f);
    form.leaf_area = 350.0f;
    form.leaf_aspect = 0.26f;
    form.leaf_droop = 0.22f;
    form.leaf_spread = 0.05f;
    form.needle_angle = 0.8f;
    form.needle_flat = true;
    const uint64_t bark_key = hashCombine(seed, 0x2b);
    form.bark = [bark_key](const Stem&, float, float, const Vec3& p) {
        return Vec3(0.75f +
                    0.25f * float(fractalNoise(bark_key, DVec3(p) * DVec3(6.0, 3.0, 6.0), 2)));
    };

    Skeleton& s = form.skeleton;
    const float trunk_length = 24.0f;
    const uint32_t trunk = growStem(s, rng, Vec3(0.0f, -0.3f, 0.0f), nearlyUp(rng, 0.02),
                                    {.length = trunk_length,
                                     .segments = 24,
                                     .radius = 0.3f,
                                     .tip_radius = 0.01f,
                                     .taper = 0.95f,
                                     .wander = 0.008f,
                                     .lift_base = 0.4f,
                                     .lift_tip = 0.4f},
                                    0);
    s.stems[trunk].leaf_from = 0.955f;
    s.stems[trunk].leaf_density = 3.0f;
    s.stems[trunk].leaf_size = 0.6f;
    // A lopsided tree: some sides have more light.
    const float lean = uniform(rng, 0.0, 2.0 * kPi), lopsided = uniform(rng, 0.03, 0.14);
    float azimuth = uniform(rng, 0.0, 2.0 * kPi);
    float y = uniform(rng, 1.6, 2.3);
    while (y < 23.2f) {
        const float top = (23.6f - y) / 21.6f;  // 1 at the lowest whorl, 0 at the top
        const int count = 6 + int(rng.uniform(0.0, 3.0));
        const float reach =
            4.1f * std::pow(top, 0.8f) * (1.0f - 0.22f * float(smoothStep(0.8, 1.0, top))) + 0.12f;
        azimuth += uniform(rng, 0.4, 1.2);
        for (int i = 0; i < count; ++i) {
            const float turn =
                azimuth + float(2.0 * kPi) * (float(i) + uniform(rng, -0.3, 0.3)) / float(count);
            // Every third one is a weak branch between the whorls.
            const bool weak = i % 3 == 2;
            const float h = y + (weak ? uniform(rng, 0.1, 0.4) : uniform(rng, -0.13, 0.13));
            const float length = reach *
                                 (weak ? uniform(rng, 0.35, 0.75) : uniform(rng, 0.72, 1.12)) *
                                 (1.0f + lopsided * std::cos(turn - lean));
            // Young branches point up, old ones hang under their weight, with tips that rise again.
            const float angle =
                glm::mix(0.75f, 1.85f, std::pow(top, 0.55f)) + uniform(rng, -0.12, 0.12);
            const uint32_t branch = branchOff(s, rng, trunk, (h + 0.3f) / trunk_length,
                                              {.angle = angle,
                                               .azimuth = turn,
                                               .length = length,
                                               .segments = 6,
                                               .radius = 0.006f + 0.012f * length,
                                               .tip_radius = 0.004f,
                                               .taper = 0.8f,
                                               .wander = 0.05f,
                                               .lift_base = -0.5f * top,
                                               .lift_tip = 0.9f * top});
            s.stems[branch].leaf_from = 0.12f;
            s.stems[branch].leaf_size = 0.6f + 0.5f * std::sqrt(top);
            s.stems[branch].leaf_density = 1.0f / s.stems[branch].leaf_size;
            const float v = uniform(rng, -1.0, 1.0);
            s.stems[branch].tint =
                Vec3(1.0f + 0.12f * v, 1.0f, 1.0f - 0.08f * v) * uniform(rng, 0.82, 1.0);
            addBranchlets(s, rng, branch, detail);
        }
        y += glm::mix(0.34f, 0.62f, top) * uniform(rng, 0.85, 1.15);
    }
    return form;
}

TreeForm growPine(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x3a)};
    TreeForm form;
    form.height = 20.0;
    form.tubes = {.root_flare = 0.25f, .relief = 0.06f, .seed = hashCombine(seed, 0x3d)};
    form.evergreen = true;
    form.bark_share = 0.22f;
    form.bark_color = Vec3(0.42f, 0.2f, 0.1f);
    form.leaf_kind = LeafKind::kNeedles;
    form.leaf_color = Vec3(0.175f, 0.235f, 0.085f);
    form.leaf_color_old = Vec3(0.8f, 0.93f, 1.0f);
    form.leaf_area = 210.0f;
    form.leaf_aspect = 0.13f;
    form.leaf_cluster = 7;
    form.leaf_droop = -0.2f;
    form.leaf_spread = 0.08f;
    form.needle_angle = 0.95f;
    const uint64_t bark_key = hashCombine(seed, 0x3b);
    form.bark = [bark_key](const Stem& stem, float, float, const Vec3& p) {
        const float n = float(fractalNoise(bark_key, DVec3(p) * DVec3(5.0, 2.5, 5.0), 2));
        // Grey-brown plates below, thin orange bark above.
        const float orange = float(smoothStep(3.5, 9.5, p.y + 2.0f * n));
        const Vec3 color = glm::mix(Vec3(0.36f, 0.52f, 0.72f), Vec3(1.0f, 0.95f, 0.9f), orange) *
                           (0.8f + 0.3f * n);
        return glm::min(stem.level >= 2 ? color * 0.55f : color, Vec3(1.0f));
    };

    Skeleton& s = form.skeleton;
    const float trunk_length = 19.3f;
    const uint32_t trunk = growStem(s, rng, Vec3(0.0f, -0.3f, 0.0f), nearlyUp(rng, 0.06),
                                    {.length = trunk_length,
                                     .segments = 22,
                                     .radius = 0.25f,
                                     .tip_radius = 0.03f,
                                     .taper = 0.8f,
                                     .wander = 0.04f,
                                     .lift_base = 0.5f,
                                     .lift_tip = 0.5f},
                                    0);
    // Dead stubs below the crown.
    for (int i = 0; i < 7; ++i) {
        const float at = uniform(rng, 0.22, 0.5);
        branchOff(s, rng, trunk, at,
                  {.angle = uniform(rng, 1.3, 1.75),
                   .azimuth = uniform(rng, 0.0, 2.0 * kPi),
                   .length = uniform(rng, 0.3, 1.3),
                   .segments = 3,
                   .radius = 0.022f,
                   .tip_radius = 0.008f,
                   .wander = 0.15f,
                   .lift_base = -0.3f});
    }
    float y = uniform(rng, 8.6, 10.0);
    float azimuth = uniform(rng, 0.0, 2.0 * kPi);
    while (y < 18.9f) {
        const float f = (y - 9.0f) / 10.0f;  // 0 at the crown's foot, 1 at its top
        const float reach =
            1.0f +
            3.5f * std::sqrt(std::max(0.0f, 1.0f - std::pow(std::abs(f - 0.38f) / 0.68f, 2.2f)));
        const int count = 2 + int(rng.uniform(0.0, 2.5));
        azimuth += uniform(rng, 0.6, 2.0);
        for (int i = 0; i < count; ++i) {
            const float turn =
                azimuth + float(2.0 * kPi) * (float(i) + uniform(rng, -0.25, 0.25)) / float(count);
            const float length = reach * uniform(rng, 0.55, 1.15);
            const float angle =
                glm::mix(1.5f, 0.6f, std::clamp(f, 0.0f, 1.0f)) + uniform(rng, -0.2, 0.2);
            const float at = (y + uniform(rng, -0.2, 0.2) + 0.3f) / trunk_length;
            const uint32_t limb =
                branchOff(s, rng, trunk, at,
                          {.angle = angle,
                           .azimuth = turn,
                           .length = length,
                           .segments = 8,
                           .radius = std::min(0.02f + 0.019f * length,
                                              0.5f * s.at(s.stems[trunk], at).radius),
                           .tip_radius = 0.01f,
                           .taper = 0.8f,
                           .wander = 0.2f,
                           .lift_base = -0.2f,
                           .lift_tip = 1.3f});
            addPineBranches(s, rng, limb, detail);
        }
        y += uniform(rng, 0.45, 1.0);
    }
    return form;
}

}  // namespace stipple
