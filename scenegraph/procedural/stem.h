// SPDX-License-Identifier: Apache-2.0
// The wood of a plant: stems (trunk, limbs, twigs) grown as polylines with radii, and the tubes
// they become.
#pragma once

#include <core/math.h>
#include <core/rng.h>
#include <scenegraph/mesh.h>

#include <cstdint>
#include <functional>
#include <vector>

namespace stipple {

struct StemNode {
    Vec3 position;  // metres
    float radius;   // metres
};

struct Stem {
    uint32_t first_node = 0;
    uint32_t node_count = 0;    // at least 2
    uint32_t level = 0;         // 0: trunk
    float length = 0.0f;        // metres
    float leaf_from = 2.0f;     // leaves grow from this fraction of its length on; above 1: none
    float leaf_density = 1.0f;  // of leaves along it, relative to other stems
    float leaf_size = 1.0f;     // relative to other stems
    Vec3 tint = Vec3(1.0f);     // of its leaves
};

struct Skeleton {
    std::vector<StemNode> nodes;
    std::vector<Stem> stems;

    const StemNode* nodesOf(const Stem& stem) const { return nodes.data() + stem.first_node; }
    // Position and radius at a fraction in [0, 1] of the stem.
    StemNode at(const Stem& stem, float fraction) const;
    // Unit direction of growth there.
    Vec3 direction(const Stem& stem, float fraction) const;
};

struct Growth {
    float angle = 0.0f;    // off the parent's direction, radians (branchOff)
    float azimuth = 0.0f;  // about the parent's direction, radians (branchOff)
    float length = 1.0f;   // metres
    int segments = 4;
    float radius = 0.1f;  // at its base, metres
    float tip_radius = 0.005f;
    float taper = 1.0f;      // exponent: 1 is a cone, below 1 stays thick for longer
    float wander = 0.1f;     // random turn per segment, radians
    float lift_base = 0.0f;  // turn towards the sky (below 0: towards the ground) over its length,
                             // radians: the rate at
    float lift_tip = 0.0f;   // the base and at the tip, linear between
};

// Adds a stem that starts at `base` towards the unit vector `direction`; returns its index.
uint32_t growStem(Skeleton& skeleton, Rng& rng, const Vec3& base, const Vec3& direction,
                  const Growth& growth, uint32_t level);

// Adds a side stem at a fraction of a parent's length, one level down; returns its index.
uint32_t branchOff(Skeleton& skeleton, Rng& rng, uint32_t parent, float fraction,
                   const Growth& growth);

// Unit vector at `angle` from the unit vector `axis`, turned by `azimuth` about it.
Vec3 offAxis(const Vec3& axis, float angle, float azimuth);
// Unit vectors that complete `axis` to a right-handed frame (side, axis, third).
void completeFrame(const Vec3& axis, Vec3& side, Vec3& third);
Vec3 randomUnit(Rng& rng);
// Unit vector at most `lean` radians off straight up.
Vec3 nearlyUp(Rng& rng, double lean);
inline float uniform(Rng& rng, double lo, double hi) { return float(rng.uniform(lo, hi)); }

// Colour of the wood at a place of a stem; angle about the stem in radians.
using BarkColor =
    std::function<Vec3(const Stem&, float fraction, float angle, const Vec3& position)>;

struct TubeStyle {
    float root_flare = 0.0f;  // how much the trunk widens where it enters the ground
    float relief = 0.0f;      // of the trunk's surface, relative to its radius
    uint64_t seed = 0;
};

// Appends tubes with smooth normals for the thickest stems, in order, as long as they fit into
// `triangle_budget` (the trunk always does). Rings are joined; each tube ends in a point.
void appendTubes(const Skeleton& skeleton, size_t triangle_budget, const TubeStyle& style,
                 const BarkColor& color, uint16_t material, Mesh& mesh);

}  // namespace stipple
