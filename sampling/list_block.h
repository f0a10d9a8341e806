// SPDX-License-Identifier: Apache-2.0
// How the points of lists are made, and kept: each is a pure function of (seed, mesh or group,
// node, index). In groups an instance is drawn by random numbers of its own at every node on the
// way to it, so that points change only where areas do: after an edit few have to be made anew.
// Based on: Wand et al. 2001 ("Sample caching"); Vitter. Random Sampling with a Reservoir. 1985.
#pragma once

#include <core/points.h>
#include <sampling/list_point.h>
#include <scenegraph/scene_editor.h>
#include <scenegraph/visible_area.h>

#include <set>
#include <utility>
#include <vector>

namespace stipple {

// Patch widths of list points are codes of metres from 2^this.
inline constexpr int kFirstMetreExponent = -14;

// 64 points, quantized to listBox(): 14 bytes each that drawing reads, then what is looked up.
struct ListBlock {
    alignas(64) uint16_t position[3][kBlockPoints];  // box.min + box.extent * q / 65535
    int16_t normal[3][kBlockPoints];                 // geometric, times 32767 x the density that it
                                                     // deserves over that of the list; 0 where an
                                                     // alpha mask says there is no surface
    uint8_t width[kBlockPoints];                     // patchWidthCode(), in metres
    uint8_t single_sided[kBlockPoints];              // 1: not seen from behind
    uint8_t alpha[kBlockPoints];  // of blended surfaces that are drawn in layers, below 255; 255
                                  // elsewhere
    // Of materials without textures: the shading normal (octahedral, 2 x 16 bits) and the albedo
    // (sRGB-encoded, 8 bits a channel). Of others the triangle and the place on it (packPlace()):
    // what is seen there depends on how far away it is.
    uint32_t normal_or_triangle[kBlockPoints];
    uint32_t albedo_or_place[kBlockPoints];
    uint16_t material[kBlockPoints];
    // In lists of groups: the instance of the group's InstanceStore or, where groups lie within,
    // the low half of the object path from there on, so many levels deep; the point is prefiltered
    // then.
    uint32_t instance[kBlockPoints];
    uint8_t levels[kBlockPoints];
    // In lists of groups: where the way to the instance leaves the list's node (Branches).
    uint8_t branch[kBlockPoints];
    Box3 box;
};

uint32_t packOctahedral(const Vec3& unit);
Vec3 unpackOctahedral(uint32_t packed);
// Barycentrics, 16 bits each.
uint32_t packPlace(Vec2 uv);
Vec2 unpackPlace(uint32_t packed);

// Names the sequences: everything their points depend on.
struct ListIdentity {
    uint64_t seed = 1;
    Sampler sampler = Sampler::kStratified;
    bool layers = false;  // blended surfaces have all their points, each with its alpha
    bool operator==(const ListIdentity&) const = default;
};

// A sequence of points: on the whole surface below a node, or, for the root of a mesh, on what can
// be seen of it from one of the directions of visible_area.h.
struct ListName {
    static constexpr int kWhole = -1;
    ChildRef child;
    uint32_t node = 0;
    int direction = kWhole;
};

// What positions of a list are quantized to: of meshes the node's bounds; of groups a box around
// them that seldom changes when they do, up to four times as wide.
Box3 listBox(const Scene& scene, ChildRef child, uint32_t node);

// What lists are made of. visible: of the mesh from the list's direction; null for whole lists.
struct ListSource {
    const Scene& scene;
    const ListIdentity& identity;
    const ListName& name;
    const VisibleArea* visible = nullptr;
};

// Points [first, first + count) of a list, into lanes from 0 on.
void makeListPoints(const ListSource& source, uint32_t first, int count, ListBlock& out);

// What has changed in groups since lists were made.
struct GroupEdits {
    using Member = std::pair<uint32_t, uint32_t>;  // of a group, by its index: one of its
    std::set<Member> nodes;
    std::set<Member> instances;  // by Group::listed_index: they came, went, moved or became others
    std::vector<std::vector<uint32_t>> names;  // of each group that has lists: listed_index then
};

// 64 points of a group's list, from `first` on, that were made before the edits: those that they
// concern are made anew, as if all were. O(points + what has changed x log of the group's size).
void remakeListPoints(const ListSource& source, const GroupEdits& edits, uint32_t first,
                      ListBlock& block);

}  // namespace stipple
