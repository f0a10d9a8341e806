// SPDX-License-Identifier: Apache-2.0
// Bushes: many stems from one root, no trunk.
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/tree_form.h>

namespace stipple {

namespace {

BarkColor plainBark(uint64_t key, double frequency) {
    return [key, frequency](const Stem& stem, float, float, const Vec3& p) {
        const float n = float(fractalNoise(key, DVec3(p) * frequency, 2));
        return Vec3(0.75f + 0.3f * n) * (stem.level >= 2 ? 0.75f : 1.0f);
    };
}

struct BushShape {
    int stems = 12;
    float base_radius = 0.3f;  // metres: where the stems leave the ground
    Range lean = {0.0, 0.8};   // off upright, radians; the outer ones lean most
    Range length = {2.0, 3.0};
    Growth stem;  // but for length
    float branches_per_metre = 4.0f;
    Range branch_angle = {0.5, 1.0};
    Range branch_length = {0.3, 0.8};  // relative to the rest of its stem
    Growth branch;                     // but for angle, azimuth and length
    float twigs_per_metre = 6.0f;
    Range twig_length = {0.15, 0.35};
    Growth twig;
};

void growBush(Skeleton& s, Rng& rng, float detail, const BushShape& shape) {
    for (int i = 0; i < shape.stems; ++i) {
        const float outer = std::sqrt((float(i) + 0.5f) / float(shape.stems));
        const float around = kGoldenAngle * float(i) + uniform(rng, -0.4, 0.4);
        const Vec3 out(std::cos(around), 0.0f, std::sin(around));
        const float lean =
            float(glm::mix(shape.lean.lo, shape.lean.hi, double(outer))) * uniform(rng, 0.7, 1.2);
        Growth growth = shape.stem;
        growth.length = uniform(rng, shape.length.lo, shape.length.hi);
        const Vec3 base = out * (shape.base_radius * outer) - Vec3(0, 0.08f * growth.length, 0);
        const Vec3 direction = glm::normalize(out * std::sin(lean) + Vec3(0, std::cos(lean), 0));
        const uint32_t stem = growStem(s, rng, base, direction, growth, i == 0 ? 0 : 1);
        const float v = uniform(rng, -1.0, 1.0);
        const Vec3 tint =
            Vec3(1.0f + 0.12f * v, 1.0f + 0.03f * v, 1.0f - 0.12f * v) * uniform(rng, 0.85, 1.0);
        s.stems[stem].leaf_from = 0.75f;
        s.stems[stem].tint = tint;
        const int count =
            countFor(rng, growth.length * shape.branches_per_metre * std::sqrt(detail), 2);
        for (int b = 0; b < count; ++b) {
            const float at = spreadAlong(rng, b, count, 0.18f);
            Growth side = shape.branch;
            side.angle = uniform(rng, shape.branch_angle.lo, shape.branch_angle.hi);
            side.azimuth = kGoldenAngle * float(b) + uniform(rng, -0.5, 0.5);
            side.length = growth.length * (1.1f - at) *
                          uniform(rng, shape.branch_length.lo, shape.branch_length.hi);
            const uint32_t branch = branchOff(s, rng, stem, at, side);
            s.stems[branch].leaf_from = 0.25f;
            s.stems[branch].tint = tint;
            addTwigs(
                s, rng, branch,
                {.count = countFor(rng, side.length * shape.twigs_per_metre * std::sqrt(detail), 1),
                 .from = 0.2f,
                 .angle = {0.5, 1.1},
                 .length = shape.twig_length,
                 .growth = shape.twig,
                 .leaf_from = 0.15f});
        }
    }
}

}  // namespace

TreeForm growHazel(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x5a)};
    TreeForm form;
    form.height = 3.2;
    form.bark_share = 0.22f;
    form.bark_color = Vec3(0.22f, 0.17f, 0.12f);
    form.bark = plainBark(hashCombine(seed, 0x5b), 9.0);
    form.leaf_color = Vec3(0.19f, 0.285f, 0.05f);
    form.leaf_color_old = Vec3(1.0f, 0.86f, 0.6f);
    form.autumn_color = Vec3(0.5f, 0.38f, 0.06f);
    form.autumn_color_late = Vec3(0.4f, 0.22f, 0.05f);
    form.leaf_area = 34.0f;
    form.leaf_aspect = 0.8f;
    form.leaf_cluster = 2;
    form.leaf_droop = 0.2f;
    form.leaf_spread = 0.5f;
    growBush(form.skeleton, rng, detail,
             {.stems = 13,
              .base_radius = 0.25f,
              .lean = {0.05, 0.75},
              .length = {2.2, 3.3},
              .stem = {.segments = 8,
                       .radius = 0.026f,
                       .tip_radius = 0.004f,
                       .wander = 0.1f,
                       .lift_base = 0.1f,
                       .lift_tip = -0.3f},
              .branches_per_metre = 3.5f,
              .branch_length = {0.25, 0.5},
              .branch = {.segments = 4,
                         .radius = 0.009f,
                         .tip_radius = 0.003f,
                         .wander = 0.15f,
                         .lift_base = 0.3f,
                         .lift_tip = 0.2f},
              .twigs_per_metre = 4.0f,
              .twig_length = {0.15, 0.4},
              .twig = {.segments = 2, .radius = 0.004f, .tip_radius = 0.002f, .wander = 0.2f}});
    return form;
}

TreeForm growJuniper(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x6a)};
    TreeForm form;
    form.height = 2.2;
    form.evergreen = true;
    form.bark_share = 0.15f;
    form.bark_color = Vec3(0.24f, 0.16f, 0.11f);
    form.bark = plainBark(hashCombine(seed, 0x6b), 8.0);
    form.leaf_kind = LeafKind::kNeedles;
    form.leaf_color = Vec3(0.125f, 0.19f, 0.085f);
    form.leaf_color_old = Vec3(0.85f, 0.95f, 1.1f);
    form.leaf_area = 11.0f;
    form.leaf_aspect = 0.22f;
    form.leaf_droop = -0.35f;
    form.leaf_spread = 0.12f;
    form.needle_angle = 0.65f;
    growBush(form.skeleton, rng, detail,
             {.stems = 15,
              .base_radius = 0.22f,
              .lean = {0.02, 0.55},
              .length = {1.1, 2.2},
              .stem = {.segments = 7,
                       .radius = 0.024f,
                       .tip_radius = 0.005f,
                       .wander = 0.08f,
                       .lift_base = 0.5f,
                       .lift_tip = 0.4f},
              .branches_per_metre = 9.0f,
              .branch_angle = {0.4, 0.8},
              .branch_length = {0.2, 0.4},
              .branch = {.segments = 3,
                         .radius = 0.007f,
                         .tip_radius = 0.003f,
                         .wander = 0.1f,
                         .lift_base = 0.8f,
                         .lift_tip = 1.0f},
              .twigs_per_metre = 9.0f,
              .twig_length = {0.08, 0.2},
              .twig = {.segments = 2,
                       .radius = 0.003f,
                       .tip_radius = 0.002f,
                       .wander = 0.1f,
                       .lift_base = 1.0f,
                       .lift_tip = 1.0f}});
    return form;
}

TreeForm growBilberry(uint64_t seed, float detail) {
    Rng rng{hashCombine(seed, 0x7a)};
    TreeForm form;
    form.height = 0.4;
    form.bark_share = 0.12f;
    form.bark_color = Vec3(0.13f, 0.15f, 0.05f);
    form.bark = plainBark(hashCombine(seed, 0x7b), 20.0);
    form.leaf_color = Vec3(0.16f, 0.255f, 0.055f);
    form.leaf_color_old = Vec3(1.1f, 0.85f, 0.6f);
    form.autumn_color = Vec3(0.36f, 0.16f, 0.05f);
    form.autumn_color_late = Vec3(0.34f, 0.05f, 0.03f);
    form.leaf_area = 3.6f;
    form.leaf_aspect = 0.6f;
    form.leaf_cluster = 2;
    form.leaf_droop = 0.0f;
    form.leaf_spread = 0.4f;
    growBush(form.skeleton, rng, detail,
             {.stems = 60,
              .base_radius = 0.75f,
              .lean = {0.1, 0.7},
              .length = {0.24, 0.42},
              .stem = {.segments = 4,
                       .radius = 0.004f,
                       .tip_radius = 0.0015f,
                       .wander = 0.2f,
                       .lift_base = 0.5f,
                       .lift_tip = 0.2f},
              .branches_per_metre = 12.0f,
              .branch_length = {0.3, 0.6},
              .branch = {.segments = 2,
                         .radius = 0.002f,
                         .tip_radius = 0.001f,
                         .wander = 0.2f,
                         .lift_base = 0.3f},
              .twigs_per_metre = 14.0f,
              .twig_length = {0.03, 0.07},
              .twig = {.segments = 2, .radius = 0.001f, .tip_radius = 0.0008f, .wander = 0.2f}});
    return form;
}

}  // namespace stipple
