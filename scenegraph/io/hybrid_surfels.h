// SPDX-License-Identifier: Apache-2.0
// Samples clusters of triangles by grids of rays, and their borders. Based on: Ni. Hybrid
// Triangle/Point Models. 2005, section 3.3; Pfister, Zwicker, van Baar, Gross. Surfels. 2000
// (three orthogonal grids).
#pragma once

#include <scenegraph/io/face_clusters.h>
#include <scenegraph/surfel_model.h>

#include <vector>

namespace stipple {

// A surfel is part of the levels [0, levels).
struct SurfelSample {
    Surfel surfel;
    uint32_t finish_key = 0;
    uint8_t levels = 1;  // until thinToLevels(): of its grid or line alone
};

// What is sampled.
struct SampledSurface {
    const Mesh& mesh;  // need not be built
    const std::vector<Material>& materials;
    const std::vector<Texture>& textures;
};

// The three directions of a flat cluster's rays: along its normal and across.
DMat3 raysFromObject(const Vec3& normal);

// Of the three, the one that a triangle faces best. Its rays alone sample the triangle, so that no
// place is sampled three times.
int rayAxis(const Mesh& mesh, uint32_t triangle, const DMat3& rays_from_object);

// Where rays `spacing` apart meet a triangle. Appends to out. O(samples).
void sampleFace(const SampledSurface& surface, uint32_t triangle, const DMat3& rays_from_object,
                float spacing, std::vector<SurfelSample>& out);

// What one grid samples.
struct SampledPieces {
    std::vector<uint32_t> piece_of;  // one a triangle
    std::vector<uint32_t> patch_of;  // one a piece
    std::vector<float> spacing;      // one a patch
};
// Places on the corners and along the borders of all pieces, between two of them once, for the
// one whose spacing is the smaller; no farther apart than its spacing. The result has one list a
// patch. O(n log n).
std::vector<std::vector<SurfelSample>> sampleBorders(const SampledSurface& surface,
                                                     const SampledPieces& pieces);

// Leaves out all but one of the samples that lie much nearer to each other than the spacing and
// face the same way, and numbers the levels of the others: each level is the one before, thinned
// evenly to about half, down to `few`. Places of even number in their grids stay longest. O(n).
void thinToLevels(std::vector<SurfelSample>& samples, float spacing, size_t few);

}  // namespace stipple
