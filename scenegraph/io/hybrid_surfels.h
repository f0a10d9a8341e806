// SPDX-License-Identifier: Apache-2.0
// Samples clusters of triangles by grids of rays, and their borders. Based on: Ni. Hybrid
// Triangle/Point Models. 2005, section 3.3; Pfister, Zwicker, van Baar, Gross. Surfels. 2000
// (three orthogonal grids).
#pragma once

#include <scenegraph/io/face_clusters.h>
#include <scenegraph/surfel_model.h>

#include <vector>

namespace stipple {

// A surfel is part of the levels [0, levels): each has about half the surfels of the one before.
struct SurfelSample {
    Surfel surfel;
    uint32_t finish_key = 0;
    uint8_t levels = 1;
};

// What is sampled.
struct SampledSurface {
    const Mesh& mesh;  // need not be built
    const std::vector<Material>& materials;
    const std::vector<Texture>& textures;
};

// Where rays of three grids, `spacing` apart, along `normal` and two directions across, meet a
// cluster's triangles: those of the grid that a triangle faces best, so that no place is sampled
// three times. Appends to out. O(triangles + samples).
void sampleFaces(const SampledSurface& surface, const std::vector<uint32_t>& triangles,
                 const Vec3& normal, float spacing, std::vector<SurfelSample>& out);

// Places on the corners and along the borders of all clusters, between two of them once, for the
// one whose spacing is the smaller; no farther apart than its spacing. spacing: one a cluster. The
// result has one list a cluster. O(n log n).
std::vector<std::vector<SurfelSample>> sampleBorders(const SampledSurface& surface,
                                                     const FaceClusters& clusters,
                                                     const std::vector<float>& spacing);

// Leaves out all but one of the samples that lie much nearer to each other than the spacing and
// face the same way: those of fewer levels go first.
void dropDoubles(std::vector<SurfelSample>& samples, float spacing);

}  // namespace stipple
