// SPDX-License-Identifier: Apache-2.0
// The triangles of meshes as one surface on which places can be drawn evenly.
#pragma once

#include <scenegraph/mesh.h>

#include <vector>

namespace stipple {

// A mesh (need not be built) and where it stands. The mesh must outlive the surface.
struct SurfacePart {
    const Mesh* mesh = nullptr;
    Affine group_from_mesh;
};

class TriangleSurface {
public:
    // 12 bytes a triangle. Triangles without an area or with wrong indices are left out.
    explicit TriangleSurface(std::vector<SurfacePart> parts);

    struct Place {
        DVec3 position;  // group space
        Vec3 normal;     // group space, unit
    };
    // The place of three numbers in [0, 1): the first picks a triangle by area, the others a point
    // in it. There must be an area.
    Place at(double t, double u, double v) const;
    double area() const { return cumulative_area_.empty() ? 0.0 : cumulative_area_.back(); }
    const DBox3& bounds() const { return bounds_; }

private:
    std::vector<SurfacePart> parts_;
    std::vector<uint64_t> first_;          // of each part: its first triangle among all
    std::vector<double> cumulative_area_;  // one a triangle, group space
    DBox3 bounds_;
};

}  // namespace stipple
