// SPDX-License-Identifier: Apache-2.0
// Where point `index` of a node's sequence lies: along the cumulated areas to an instance, a
// triangle and a place on it. Based on: Wand et al. 2001 ("Precomputation: Distribution List");
// van der Corput sequence; Basu, Owen. Low discrepancy constructions in the triangle. 2015 (the
// remainder steers a 4-way subdivision of the triangle).
#pragma once

#include <core/rng.h>
#include <core/settings.h>
#include <scenegraph/scene.h>

namespace stipple {

// Names one point's random numbers.
struct PointKey {
    Sampler sampler = Sampler::kStratified;
    uint64_t list = 0;  // hash of the node
    uint32_t index = 0;
};

// Where point `index` lies along the cumulated areas, in [0, 1): van der Corput, scrambled and
// shifted at random, or random.
double listPosition(const PointKey& key);

// Where on a mesh a point lies.
struct MeshPoint {
    uint32_t triangle = 0;
    float u = 0.0f, v = 0.0f;
};

// The place at `position`, in [0, 1), along the areas of a mesh's node: uniform over its area if
// the position is. cumulative_area: of the mesh's triangles, doubles (the whole area) or floats
// (what is visible).
template <class T>
MeshPoint meshPointAt(const std::vector<T>& cumulative_area, const MeshNode& node, double position,
                      const PointKey& key);

// An instance below a group's node.
struct InstancePoint {
    uint32_t instance = 0;
    double position = 0.0;  // along the areas of its child, in [0, 1)
};

// The instance at `position`, in [0, 1), along the areas (each the child's times the transform's
// largest area scale) below a node. O(log n).
InstancePoint instanceAt(const Scene& scene, const Group& group, uint32_t node, double position);

// Where one may go on from a group's node: to a child, or to the residents of one of sixteen kinds,
// by their names. Their codes: the child's number, or eight and the kind.
struct Branches {
    static constexpr uint8_t kChildren = 8, kKinds = 16;
    static uint8_t codeOfResident(uint32_t listed_index) {
        // Neighbours, in rows of a grid and below each other, differ.
        uint32_t fold = listed_index ^ listed_index >> 16;
        fold ^= fold >> 8;
        return uint8_t(kChildren + (fold ^ fold >> 4) % kKinds);
    }
    static bool isChild(uint8_t code) { return code < kChildren; }

    // O(children + residents).
    Branches(const Scene& scene, const Group& group, uint32_t node);
    // One of them, in proportion to their areas, by u, uniform in [0, 1).
    uint8_t at(double u) const;

    double area[kChildren + kKinds] = {};  // by code
    double sum = 0.0;
};

// The random numbers of a list's point on its way down a group's octree, and those within. Every
// place on the way has its own, so none changes when others do; all points of a list that come by
// there have numbers that are spread evenly, as far as Sobol's dimensions go.
class WayNumbers {
public:
    explicit WayNumbers(const PointKey& key) : key_(key), way_(key.list) {}

    // For the next choice, in [0, 1). The first is listPosition().
    double next();
    // Only for this place, for each of what is there.
    uint64_t hash(uint32_t what) const { return hashCombine(way_, key_.index, what, 3); }
    void goToChild(uint32_t node) { way_ = hashCombine(way_, node, 1); }
    void goToInstance(uint32_t listed_index) { way_ = hashCombine(way_, listed_index, 2); }

private:
    PointKey key_;
    uint64_t way_;
    int dimension_ = 0;
};

struct ChosenInstance {
    uint32_t instance = 0;  // its place in the InstanceStore
    uint8_t branch = 0;     // of the node where the way begins
};

// An instance below a node, in proportion to areas as instanceAt(). Where areas change, so do few
// of the choices: of those that fell elsewhere about the share of the change in the sum. The way
// goes on to the instance. O(log n + residents).
ChosenInstance chooseInstance(const Scene& scene, const Group& group, uint32_t node,
                              WayNumbers& way);

}  // namespace stipple
