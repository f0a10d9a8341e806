// SPDX-License-Identifier: Apache-2.0
// Points of clouds, and the planes that they lie on: of their neighbours, all turned the same way,
// and next to a crease those of one side of it alone.
#pragma once

#include <core/parallel.h>
#include <scenegraph/io/point_index.h>

#include <vector>

namespace stipple {

struct SplatPoint {
    Vec3 position = Vec3(0);
    Vec3 normal = Vec3(0);   // unit, or null where it is not known
    Vec3 color = Vec3(0);    // sRGB, 0..1
    float spacing = 0.0f;    // mean distance to the nearest points
    float roughness = 0.0f;  // of the neighbourhood: how little it is a plane, 0..1/3
    uint8_t finish = 0;
    bool is_at_crease = false;      // its plane is that of one side
    bool is_facing = false;         // its normal is that of a surface, and stays
    Vec3 shading_normal = Vec3(0);  // unit, of a surface; null: `normal` is as good
};

using SplatPoints = std::vector<SplatPoint>;

// Of points at the very same place that face alike and have one finish, the first stays; so do the
// first few that do not. Returns how many go. O(n log n).
size_t joinSamePlaces(SplatPoints& points);

// Fits a plane to the `neighbours` nearest points of point i: spacing, roughness and, where the
// neighbours have a plane, the normal (unless it is facing), on the side of the normal there was.
// `near`: scratch.
void fitPlane(SplatPoints& points, const PointIndex& index, int neighbours, uint32_t i,
              std::vector<NearPoint>& near);

// The plane of one side for point i next to a crease: is_at_crease and the normal, on the side of
// the normal there was. Planes have been fitted to the points around. Null if it lies next to none.
Vec3 normalBesideCrease(const SplatPoints& points, const PointIndex& index, int neighbours,
                        uint32_t i, std::vector<NearPoint>& near);

// All of the above for all points. Where given normals do not agree with each other, they are
// turned so that neighbours do, from the top of each part down (Hoppe et al. Surface Reconstruction
// from Unorganized Points. 1992). Those of points that are facing stay as they are. The same for
// any number of threads. Throws kCancelled. O(n log n).
void findNormals(SplatPoints& points, const PointIndex& index, int neighbours, ThreadPool& pool,
                 const CancelFlag& cancel);

}  // namespace stipple
