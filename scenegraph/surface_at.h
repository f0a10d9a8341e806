// SPDX-License-Identifier: Apache-2.0
// Attributes at a place on a mesh: the one interpolation that points, rasterized triangles and rays
// share.
#pragma once

#include <core/material.h>
#include <core/surface.h>
#include <scenegraph/mesh.h>

namespace stipple {

struct MeshSurface {
    Vec3 normal_object = Vec3(0);  // unit, shading normal; geometric where the mesh has none
    Vec3 albedo = Vec3(0);         // linear
    float alpha = 1.0f;
    SurfaceFinish finish;
};

// What a lookup stands for (texture filtering), in object space: the surface within a beam of that
// diameter and direction (need not be unit). Diameter 0: the finest level; direction 0: a circle.
struct LookupBeam {
    float diameter = 0.0f;
    Vec3 direction = Vec3(0);
};

// At barycentrics (1 - u - v, u, v) of a triangle.
MeshSurface surfaceAt(const Mesh& mesh, const std::vector<Material>& materials,
                      const std::vector<Texture>& textures, uint32_t triangle, float u, float v,
                      const LookupBeam& beam);

// Of a material without its textures.
SurfaceFinish plainFinish(const Material& material);

// Alpha alone (for masks).
float alphaAt(const Mesh& mesh, const std::vector<Material>& materials,
              const std::vector<Texture>& textures, uint32_t triangle, float u, float v);

}  // namespace stipple
