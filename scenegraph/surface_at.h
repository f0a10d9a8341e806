// SPDX-License-Identifier: Apache-2.0
// Attributes at a place on a mesh: the one interpolation that points, rasterized triangles and rays
// share.
#pragma once

#include <core/material.h>
#include <scenegraph/mesh.h>

namespace stipple {

struct MeshSurface {
    Vec3 normal_object = Vec3(0);  // unit, shading normal; geometric where the mesh has none
    Vec3 albedo = Vec3(0);         // linear
    float alpha = 1.0f;            // material x texture x vertex alpha
};

// At barycentrics (1 - u - v, u, v) of a triangle. footprint_object: diameter of what the lookup
// stands for, in object space (texture filtering); 0 for the finest level.
MeshSurface surfaceAt(const Mesh& mesh, const std::vector<Material>& materials,
                      const std::vector<Texture>& textures, uint32_t triangle, float u, float v,
                      float footprint_object);

// Alpha alone (for masks).
float alphaAt(const Mesh& mesh, const std::vector<Material>& materials,
              const std::vector<Texture>& textures, uint32_t triangle, float u, float v);

}  // namespace stipple
