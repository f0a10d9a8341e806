// SPDX-License-Identifier: Apache-2.0
// What tells one kind of tree or bush from another: how its wood grows, and what its leaves and
// bark look like. tree.cpp turns a form into a mesh. Lengths are those of a tree of the species'
// own height; the mesh is scaled at the end.
#pragma once

#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/season.h>
#include <scenegraph/procedural/stem.h>

#include <cstdint>

namespace stipple {

enum class LeafKind {
    kBlade,   // a folded blade of 2 triangles
    kNeedles  // a shoot with its needles: 1 triangle
};

struct TreeForm {
    double height = 0.0;  // metres, typical
    Skeleton skeleton;
    TubeStyle tubes;
    float bark_share = 0.3f;       // of the triangles
    BarkColor bark;                // multiplied with bark_color
    Vec3 bark_color = Vec3(0.2f);  // linear
    int bark_marks = 0;            // dark strips across the trunk at 20 000 triangles

    LeafKind leaf_kind = LeafKind::kBlade;
    bool evergreen = false;
    Vec3 leaf_color = Vec3(0.2f);      // linear, of the brightest leaves
    Vec3 leaf_color_old = Vec3(1.0f);  // multiplies the colour of some: yellowing, or blue-green
    Vec3 autumn_color = Vec3(0.45f, 0.3f, 0.05f);        // linear, of leaves that have turned
    Vec3 autumn_color_late = Vec3(0.35f, 0.13f, 0.03f);  // linear, of those that turned first
    float winter_leaves = 0.0f;                          // share of brown leaves that stay
    float leaf_area = 100.0f;   // one-sided, of all leaves, m^2: what a full crown needs, however
                                // many triangles there are
    float leaf_aspect = 0.6f;   // width / length of a blade, or of a shoot with its needles
    int leaf_cluster = 1;       // leaves that grow from one place
    float leaf_droop = 0.3f;    // 0: leaves stand out from the twig, 1: they hang
    float leaf_spread = 0.5f;   // scatter of leaves about their twig, in leaf lengths
    float needle_angle = 0.8f;  // between shoots and twig, radians
    bool needle_flat = false;   // shoots in the plane of the branch (spruce) or all around (pine)
};

// A mesh of about `triangles` triangles (within 10 %), scaled to `height` metres.
GeneratedMesh buildTree(const TreeForm& form, uint64_t seed, size_t triangles, double height,
                        Season season);

// detail: 1 for 20 000 triangles; a finer tree has more twigs.
TreeForm growOak(uint64_t seed, float detail);
TreeForm growBeech(uint64_t seed, float detail);
TreeForm growBirch(uint64_t seed, float detail);
TreeForm growSpruce(uint64_t seed, float detail);
TreeForm growPine(uint64_t seed, float detail);
// detail: 1 for 6000 triangles.
TreeForm growHazel(uint64_t seed, float detail);
TreeForm growJuniper(uint64_t seed, float detail);
TreeForm growBilberry(uint64_t seed, float detail);

inline constexpr float kGoldenAngle = 2.39996323f;

// An integer of that expectation, but at least `least`.
inline int countFor(Rng& rng, float expected, int least) {
    return std::max(least, int(roundAtRandom(expected, rng.next())));
}

// The place of the i-th of `count` shoots spread over [from, 1] of a stem.
inline float spreadAlong(Rng& rng, int i, int count, float from) {
    return from + (1.0f - from) * (float(i) + uniform(rng, 0.0, 1.0)) / float(count);
}

struct Range {
    double lo, hi;
};

// Short shoots all around a branch, which carry leaves.
struct Twigs {
    int count = 1;
    float from = 0.2f;         // fraction of the branch that is bare
    Range angle = {0.5, 1.0};  // off the branch, radians
    Range length = {0.4, 1.0};
    Growth growth;  // but for angle, azimuth and length
    float leaf_from = 0.2f;
};
void addTwigs(Skeleton& skeleton, Rng& rng, uint32_t branch, const Twigs& twigs);

}  // namespace stipple
