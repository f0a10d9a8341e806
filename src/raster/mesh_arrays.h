// SPDX-License-Identifier: Apache-2.0
// A mesh's arrays in the order in which the GL draws them fastest, and its triangles in runs of one
// surface state.
#pragma once

#include <raster/rasterizer.h>

#include <vector>

namespace stipple {

// What the GL must know of a triangle's material.
struct SurfaceState {
    bool double_sided = false;
    bool hidden = false;       // all of it is below the cutoff: not drawn
    int masked_material = -1;  // fragments are tested against this material's mask; -1: opaque

    bool operator==(const SurfaceState&) const = default;
};

struct MeshRun {
    uint32_t first = 0;  // triangles [first, first + count) share the state
    uint32_t count = 0;
    SurfaceState state;
};

struct MeshArrays {
    std::vector<Vec3> positions;  // vertex t is a corner of triangle t, further vertices follow
    std::vector<Vec3> masks;      // u, v and vertex alpha; empty if no triangle is masked
    std::vector<UVec3>
        triangles;  // the last corner of triangle t is vertex t; winding and order as in the mesh
    std::vector<MeshRun> runs;  // ascending, cover all triangles
    Box3 bounds;
};

// The smallest and largest value of an alpha.
struct AlphaRange {
    float min = 1.0f;
    float max = 1.0f;
};

// Fragments with less alpha are not there.
float alphaCutoff(const Material& material);

// Range of the alpha of level 0; (1, 1) for an empty texture.
AlphaRange alphaRange(const Texture& texture);

// GL takes a flat value from a triangle's last corner, so giving every triangle a last corner of
// its own makes gl_VertexID its number. gl_PrimitiveID would do the same without the copies, but
// makes llvmpipe take a path that is half as fast. texture_alpha: one a texture. O(triangles).
MeshArrays makeMeshArrays(const RasterMesh& mesh, const std::vector<Material>& materials,
                          const std::vector<AlphaRange>& texture_alpha);

}  // namespace stipple
