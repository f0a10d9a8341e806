// SPDX-License-Identifier: Apache-2.0
// What of a mesh can be seen from far away, from each of 32 directions. Most of a crown hides
// behind its own front: points there only cost time, and, where the crown is a few subpixels wide,
// they make it too wide. Based on: Grossman. Point Sample Rendering. 1998, section 6.2 (visibility
// by direction, here for triangles); Cook, Halstead, Planck, Ryu. Stochastic Simplification of
// Aggregate Detail. 2007 (fewer elements that cover as much).
#pragma once

#include <core/material.h>
#include <scenegraph/mesh.h>

#include <array>
#include <vector>

namespace stipple {

// The octants of the sphere, each split in four.
inline constexpr int kDirections = 32;
// The part of the sphere in which a direction (not null, any length) lies.
int directionIndex(const Vec3& direction);
Vec3 directionOf(int index);  // its centre, unit

// How many points, as a multiple of those that their density asks for, make a mesh cover, in
// expectation, what rays would find: by the distance between points, an octave each.
struct SpacingTable {
    static constexpr int kOctaves = 16;
    float first_spacing = 1.0f;  // object space, m
    std::array<float, kOctaves> factors = {};

    float at(float spacing) const;  // interpolated
};

// Whether there may be much of a mesh that its own front hides, and measuring it pays.
bool hidesItself(const Mesh& mesh);

struct VisibleArea {
    // What the triangles before each cover of the picture (at right angles to the direction, object
    // space, m^2): triangles.size() + 1 entries, a distribution list.
    std::vector<float> cumulative;
    // Of what the mesh covers: four times its area over its outline, that of a square patch.
    float patch_width = 0.0f;
    // For points on the visible area: above 1 where gaps are finer than the points' distances.
    SpacingTable visible_factor;
    // For points on the whole surface: falls with the distance, as layers show through each other.
    SpacingTable whole_factor;
    float layers = 1.0f;  // of surface, one behind the other, where there is any

    double covered() const { return double(cumulative.back()); }
};

// Draws the mesh towards `direction` (to a far eye; object space) into a small grid and counts what
// is in front. Masks and blended surfaces are tested; single-sided triangles are seen from the
// front only. Affine maps of the mesh keep what it says: it is about shares of each triangle. The
// mesh has been built. About 2 ms for 20 000 triangles.
VisibleArea measureVisibleArea(const Mesh& mesh, const std::vector<Material>& materials,
                               const std::vector<Texture>& textures, const Vec3& direction);

}  // namespace stipple
