// SPDX-License-Identifier: Apache-2.0
// Cones of normals: how alike the triangles below a node face. Based on: Wand et al. 2001
// ("classification by orientation"); cones as in Shirman and Abi-Ezzi. The Cone of Normals
// Technique for Fast Processing of Curved Patches. 1993.
#pragma once

#include <core/math.h>

#include <vector>

namespace stipple {

// Every normal n of the surface, or -n (both sides count), is within an angle of the axis.
struct NormalCone {
    Vec3 axis = Vec3(0.0f, 0.0f, 1.0f);  // unit, object space
    float cos_spread = 0.0f;             // cosine of that angle; 0: any direction
};

// A cone around cones, weighted by the areas that they stand for. O(n).
struct WeightedCone {
    NormalCone cone;
    double area = 0.0;
};
NormalCone surroundingCone(const std::vector<WeightedCone>& parts);

// The largest |cos beta| that a surface in the box with normals in the cone shows to the eye, by
// which its projection factor is bounded (sampling/projection.h). eye: in the cone's space;
// orthographic: the direction towards the eye. Never less than a small number, which points that
// are rounded need.
float largestCosine(const NormalCone& cone, const Box3& box, const DVec3& eye, bool orthographic);

}  // namespace stipple
