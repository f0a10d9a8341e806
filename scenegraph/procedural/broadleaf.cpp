// SPDX-License-Identifier: Apache-2.0
// Oak, beech and birch: limbs reach for a crown's outline, branches and twigs fill it.
// Based on: Weber, Penn. Creation and Rendering of Realistic Trees. 1995 (levels of stems with
// angle, length, curve and taper each).
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/tree_form.h>

namespace stipple {

namespace {

// An egg with bumps: what limbs grow up to.
struct CrownOutline {
    Vec3 center;
    float radius;             // horizontal, metres
    float up, down;           // metres
    float roughness = 0.15f;  // relative height of the bumps
    uint64_t key = 0;

    bool contains(const Vec3& p) const {
        const Vec3 d = p - center;
        const Vec3 u(d.x / radius, d.y / (d.y > 0.0f ? up : down), d.z / radius);
        const float r = glm::length(u);
        if (r < 0.5f) return true;
        return r < 1.0f + roughness * float(gradientNoise(key, DVec3(u * (1.6f / r)))) * 2.0f;
    }
    // How far one can go from p inside, at most max_length.
    float reach(const Vec3& p, const Vec3& direction, float max_length) const {
        constexpr float kStep = 0.25f;
        float length = kStep;
        while (length < max_length && contains(p + direction * length)) length += kStep;
        return std::min(length, max_length);
    }
};

// A tint that a whole branch shares, so that a crown is not grey noise of single leaves.
Vec3 branchTint(Rng& rng) {
    const float v = uniform(rng, -1.0, 1.0);
    return Vec3(1.0f + 0.14f * v, 1.0f + 0.03f * v, 1.0f - 0.15f * v) * uniform(rng, 0.84, 1.0);
}

// Branches from a fraction of a limb (or of the trunk) on, crooked, with twigs.
void addBroadleafBranches(Skeleton& s, Rng& rng, const CrownOutline& outline, uint32_t limb,
                          float from, float detail) {
    const Stem parent = s.stems[limb];
    const int count = countFor(rng, parent.length * (1.0f - from) * 2.6f * std::sqrt(detail), 3);
    float azimuth = uniform(rng, 0.0, 2.0 * kPi);
    for (int i = 0; i < count; ++i) {
        const float at = spreadAlong(rng, i, count, from);
        azimuth += kGoldenAngle + uniform(rng, -0.5, 0.5);
        const StemNode node = s.at(parent, at);
        const Vec3 direction = offAxis(s.direction(parent, at), uniform(rng, 0.6, 1.15), azimuth);
        const float longest =
            std::min(0.35f + 0.52f * parent.length * (1.15f - at), 3.2f) * uniform(rng, 0.75, 1.1);
        const float length = std::max(outline.reach(node.position, direction, longest), 0.6f);
        const float radius = std::min(0.55f * node.radius, 0.012f + 0.014f * length);
        const uint32_t branch = growStem(s, rng, node.position, direction,
                                         {.length = length,
                                          .segments = 5,
                                          .radius = radius,
                                          .tip_radius = 0.005f,
                                          .taper = 0.9f,
                                          .wander = 0.2f,
                                          .lift_base = 0.2f,
                                          .lift_tip = 0.5f},
                                         2);
        s.stems[branch].leaf_from = 0.45f;
        s.stems[branch].tint = branchTint(rng);
        const Growth twig{.segments = 2,
                          .radius = 0.009f,
                          .tip_radius = 0.003f,
                          .wander = 0.25f,
                          .lift_base = 0.2f,
                          .lift_tip = 0.3f};
        addTwigs(s, rng, branch,
                 {.count = countFor(rng, (1.5f + 3.2f * length) * std::sqrt(detail), 2),
                  .from = 0.2f,
                  .angle = {0.5, 1.2},
                  .length = {0.45, 1.05},
                  .growth = twig,
                  .leaf_from = 0.25f});
    }
}

// Branches that bend down at their ends, with twigs that hang like curtains.
void addBirchBranches(Skeleton& s, Rng& rng, uint32_t limb, float detail) {
    const float limb_length = s.stems[limb].length;
    const Vec3 tint = s.stems[limb].tint;
    const int count = countFor(rng, (1.0f + limb_length * 2.3f) * std::sqrt(detail), 2);
    float azimuth = uniform(rng, 0.0, 2.0 * kPi);
    for (int i = 0; i < count; ++i) {
        const float at = spreadAlong(rng, i, count, 0.2f);
        azimuth += kGoldenAngle + uniform(rng, -0.5, 0.5);
        const float length = (0.5f + 0.32f * limb_length * (1.1f - at)) * uniform(rng, 0.8, 1.3);
        const uint32_t branch = branchOff(s, rng, limb, at,
                                          {.angle = uniform(rng, 0.5, 0.95),
                                           .azimuth = azimuth,
                                           .length = length,
                                           .segments = 4,
                                           .radius = 0.005f + 0.005f * length,
                                           .tip_radius = 0.003f,
                                           .taper = 0.8f,
                                           .wander = 0.12f,
                                           .lift_base = 0.2f,
                                           .lift_tip = -2.6f});
        s.stems[branch].leaf_from = 0.2f;
        s.stems[branch].tint = tint;
        const Growth twig{.segments = 3,
                          .radius = 0.005f,
                          .tip_radius = 0.002f,
                          .taper = 0.7f,
                          .wander = 0.1f,
                          .lift_base = -2.0f,
                          .lift_tip = -2.5f};
        addTwigs(s, rng, branch,
                 {.count = countFor(rng, 3.2f * length * std::sqrt(detail), 1),
                  .from = 0.25f,
                  .angle = {0.4, 0.9},
                  .length = {0.4, 1.0},
                  .growth = twig,
                  .leaf_from = 0.15f});
    }
}

// A trunk with limbs that reach for the outline, spiralling up.
struct BroadleafShape {
    CrownOutline outline;
    Growth trunk;
    int limbs = 20;
    float first_limb = 0.2f;        // fraction of the trunk
    Range limb_angle = {1.3, 0.5};  // off the trunk, of the lowest and of the highest limb, radians
    float limb_wander = 0.15f;
    float limb_lift = 0.7f;
};

void growBroadleaf(Skeleton& s, Rng& rng, float detail, const BroadleafShape& shape) {
    const uint32_t trunk =
        growStem(s, rng, Vec3(0.0f, -0.3f, 0.0f), nearlyUp(rng, 0.08), shape.trunk, 0);
    std::vector<uint32_t> limbs;
    const float first_azimuth = uniform(rng, 0.0, 2.0 * kPi);
    for (int i = 0; i < shape.limbs; ++i) {
        const float f = (float(i) + uniform(rng, 0.1, 0.9)) / float(shape.limbs);
        const float at = glm::mix(shape.first_limb, 0.95f, f);
        const float angle = float(glm::mix(shape.limb_angle.lo, shape.limb_angle.hi, double(f))) +
                            uniform(rng, -0.18, 0.18);
        const float azimuth = first_azimuth + kGoldenAngle * float(i) + uniform(rng, -0.4, 0.4);
        const StemNode node = s.at(s.stems[trunk], at);
        const Vec3 direction = offAxis(s.direction(s.stems[trunk], at), angle, azimuth);
        const float length =
            shape.outline.reach(node.position, direction, 9.5f) * uniform(rng, 0.8, 1.03);
        const float radius = std::min(0.66f * node.radius, 0.03f + 0.027f * length);
        limbs.push_back(growStem(s, rng, node.position, direction,
                                 {.length = length,
                                  .segments = 9,
                                  .radius = radius,
                                  .tip_radius = 0.012f,
                                  .taper = 0.9f,
                                  .wander = shape.limb_wander,
                                  .lift_base = 0.15f,
                                  .lift_tip = shape.limb_lift},
                                 1));
    }
    for (const uint32_t limb : limbs)
        addBroadleafBranches(s, rng, shape.outline, limb, 0.3f, detail);
    addBroadleafBranches(s, rng, shape.outline, trunk, 0.66f, detail);
}

}  // namespace

TreeForm growOak(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x0a)};
    TreeForm form;
    form.height = 16.0;
    form.tubes = {.root_flare = 0.45f, .relief = 0.07f, .seed = hashCombine(seed, 0x0d)};
    form.bark_color = Vec3(0.15f, 0.115f, 0.085f);
    form.leaf_color = Vec3(0.175f, 0.265f, 0.05f);
    form.leaf_color_old = Vec3(1.0f, 0.83f, 0.6f);
    form.autumn_color = Vec3(0.33f, 0.24f, 0.05f);
    form.autumn_color_late = Vec3(0.34f, 0.14f, 0.035f);
    form.winter_leaves = 0.04f;
    form.leaf_cluster = 4;
    form.bark_share = 0.2f;
    form.leaf_area = 400.0f;
    form.leaf_aspect = 0.62f;
    form.leaf_droop = 0.25f;
    form.leaf_spread = 0.9f;
    const uint64_t bark_key = hashCombine(seed, 0x0b);
    form.bark = [bark_key](const Stem&, float, float, const Vec3& p) {
        const float n = float(fractalNoise(bark_key, DVec3(p) * DVec3(7.0, 1.5, 7.0), 3));
        const float moss = float(smoothStep(1.4, -0.2, p.y)) * 0.5f;
        return glm::mix(Vec3(0.72f + 0.4f * n), Vec3(0.62f, 0.85f, 0.45f), moss);
    };

    growBroadleaf(
        form.skeleton, rng, detail,
        {.outline = {Vec3(0.0f, 9.0f, 0.0f), 6.9f, 6.9f, 5.6f, 0.17f, hashCombine(seed, 0x0c)},
         .trunk = {.length = 12.2f,
                   .segments = 24,
                   .radius = 0.42f,
                   .tip_radius = 0.05f,
                   .taper = 0.85f,
                   .wander = 0.06f,
                   .lift_base = 0.3f,
                   .lift_tip = 0.3f},
         .limbs = 17,
         .first_limb = 0.2f,
         .limb_angle = {1.3, 0.5},
         .limb_wander = 0.2f,
         .limb_lift = 0.8f});
    return form;
}

TreeForm growBeech(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x4a)};
    TreeForm form;
    form.height = 22.0;
    form.tubes = {.root_flare = 0.5f, .relief = 0.015f, .seed = hashCombine(seed, 0x4d)};
    form.bark_color = Vec3(0.29f, 0.285f, 0.265f);
    form.leaf_color = Vec3(0.17f, 0.285f, 0.045f);
    form.leaf_color_old = Vec3(1.05f, 0.9f, 0.65f);
    form.autumn_color = Vec3(0.5f, 0.27f, 0.035f);
    form.autumn_color_late = Vec3(0.4f, 0.12f, 0.025f);
    form.winter_leaves = 0.02f;
    form.bark_share = 0.18f;
    form.leaf_area = 560.0f;
    form.leaf_aspect = 0.62f;
    form.leaf_cluster = 3;
    form.leaf_droop = 0.1f;
    form.leaf_spread = 0.75f;
    const uint64_t bark_key = hashCombine(seed, 0x4b);
    form.bark = [bark_key](const Stem&, float, float, const Vec3& p) {
        // Smooth and silvery, with blotches of lichen and a green foot.
        const float n = float(fractalNoise(bark_key, DVec3(p) * DVec3(2.5, 1.8, 2.5), 3));
        const float moss = float(smoothStep(1.8, 0.0, p.y + 1.2 * n)) * 0.6f;
        return glm::mix(Vec3(0.72f + 0.35f * n), Vec3(0.35f, 0.52f, 0.22f), moss);
    };
    growBroadleaf(
        form.skeleton, rng, detail,
        {.outline = {Vec3(0.0f, 12.5f, 0.0f), 6.6f, 9.4f, 8.2f, 0.12f, hashCombine(seed, 0x4c)},
         .trunk = {.length = 18.5f,
                   .segments = 26,
                   .radius = 0.4f,
                   .tip_radius = 0.04f,
                   .taper = 0.9f,
                   .wander = 0.03f,
                   .lift_base = 0.5f,
                   .lift_tip = 0.4f},
         .limbs = 26,
         .first_limb = 0.24f,
         .limb_angle = {1.15, 0.4},
         .limb_wander = 0.11f,
         .limb_lift = 0.45f});
    return form;
}

TreeForm growBirch(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x1a)};
    TreeForm form;
    form.height = 18.0;
    form.tubes = {.root_flare = 0.3f, .relief = 0.02f, .seed = hashCombine(seed, 0x1d)};
    form.bark_color = Vec3(0.74f, 0.72f, 0.67f);
    form.bark_share = 0.22f;
    form.bark_marks = 90;
    form.leaf_color = Vec3(0.25f, 0.355f, 0.065f);
    form.leaf_color_old = Vec3(1.0f, 0.88f, 0.55f);
    form.autumn_color = Vec3(0.62f, 0.42f, 0.05f);
    form.autumn_color_late = Vec3(0.5f, 0.26f, 0.04f);
    form.leaf_cluster = 2;
    form.leaf_area = 155.0f;
    form.leaf_aspect = 0.7f;
    form.leaf_droop = 0.75f;
    form.leaf_spread = 0.6f;
    const uint64_t bark_key = hashCombine(seed, 0x1b);
    form.bark = [bark_key](const Stem& stem, float, float, const Vec3& p) {
        if (stem.level >= 2) return Vec3(0.13f, 0.085f, 0.07f);
        const float n = float(fractalNoise(bark_key, DVec3(p) * DVec3(4.0, 7.0, 4.0), 2));
        Vec3 color = Vec3(0.92f, 0.92f, 0.9f) + 0.08f * n;
        if (stem.level == 1) return color * 0.4f * Vec3(1.0f, 0.88f, 0.8f);
        // The foot of an old birch is black and cracked.
        const float rough = float(smoothStep(0.1, 0.5, n + 1.3 * smoothStep(2.2, 0.0, p.y) - 0.35));
        return glm::mix(color, Vec3(0.13f, 0.12f, 0.115f), rough);
    };

    Skeleton& s = form.skeleton;
    const CrownOutline outline{Vec3(0.0f, 9.2f, 0.0f), 3.4f, 8.9f, 6.8f, 0.13f,
                               hashCombine(seed, 0x1c)};
    const uint32_t trunk = growStem(s, rng, Vec3(0.0f, -0.3f, 0.0f), nearlyUp(rng, 0.07),
                                    {.length = 17.4f,
                                     .segments = 26,
                                     .radius = 0.19f,
                                     .tip_radius = 0.008f,
                                     .taper = 0.95f,
                                     .wander = 0.028f,
                                     .lift_base = 0.5f,
                                     .lift_tip = 0.2f},
                                    0);
    const int limb_count = 36;
    float limb_azimuth = uniform(rng, 0.0, 2.0 * kPi);
    for (int i = 0; i < limb_count; ++i) {
        const float f = (float(i) + uniform(rng, 0.0, 1.0)) / float(limb_count);
        const float at = 0.2f + 0.78f * f;
        limb_azimuth += kGoldenAngle + uniform(rng, -0.4, 0.4);
        const float angle = glm::mix(0.95f, 0.5f, f) + uniform(rng, -0.12, 0.12);
        const StemNode node = s.at(s.stems[trunk], at);
        const Vec3 direction = offAxis(s.direction(s.stems[trunk], at), angle, limb_azimuth);
        const float length = std::max(
            outline.reach(node.position, direction, 4.6f) * uniform(rng, 0.78, 1.05), 0.7f);
        const uint32_t limb =
            growStem(s, rng, node.position, direction,
                     {.length = length,
                      .segments = 7,
                      .radius = std::min(0.5f * node.radius, 0.008f + 0.011f * length),
                      .tip_radius = 0.004f,
                      .taper = 0.9f,
                      .wander = 0.07f,
                      .lift_base = 0.9f,
                      .lift_tip = -2.2f},
                     1);
        s.stems[limb].leaf_from = 0.7f;
        s.stems[limb].tint = branchTint(rng);
        addBirchBranches(s, rng, limb, detail);
    }
    s.stems[trunk].leaf_from = 0.93f;
    return form;
}

}  // namespace stipple
