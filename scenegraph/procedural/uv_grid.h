// SPDX-License-Identifier: Apache-2.0
// Grids: parametric surfaces whose points tables move, as meshes. Based on: Levoy, Whitted. The Use
// of Points as a Display Primitive. 1985 (sections 4.3 perturbation, 4.5 density and where a
// surface pulls apart, 5 conversion of geometries).
//
// Vertices lie where the tables' texels do, or at the mip level of a coarser grid, so the mesh
// shows all that the tables say at its resolution, its normals what they say beyond, and points,
// rays, z-buffer, shadows and picking meet on one surface. Points are then drawn by area: their
// density over u and v is the Jacobian determinant, and no stretch of cells makes them sparse.
#pragma once

#include <core/material.h>
#include <core/parallel.h>
#include <scenegraph/mesh.h>
#include <scenegraph/procedural/uv_grid_surface.h>
#include <scenegraph/procedural/uv_grid_table.h>

#include <functional>

namespace stipple {

struct GridDisplacement {
    enum class Along { kNormal, kSurface, kObject };
    GridTable table;               // metres
    Along along = Along::kNormal;  // x alone along the normal; or x, y, z: along u, v and the
                                   // normal; or along the object's axes
    DVec2 repeat = DVec2(1.0);     // times along u and v
};

struct UvGridParams {
    GridShape shape;
    std::vector<GridDisplacement> displacements;  // added up
    DVec2 texture_repeat = DVec2(1.0);
    bool has_normal_map = false;   // the mesh needs tangents
    int cells_u = 0, cells_v = 0;  // 0: as many as the tables have texels, kMostCells in all
    int refine = 0;                // cells are halved up to so many times where the surface
                                   // bends or stretches, kMostRefine at most
    std::function<void(double triangles)> reserve;  // called before so many more are made
};
inline constexpr double kMostCells = 1 << 20;
inline constexpr int kMostRefine = 6;

// How unevenly tables have stretched the surface: how many times as much a triangle as the one
// beside it. Above kMostStretch it shows: light and texture change from cell to cell.
struct GridStretch {
    double most = 1.0;
    double u = 0.0, v = 0.0;  // where
    double share = 0.0;       // of the edges: above kMostStretch
};
inline constexpr double kMostStretch = 4.0;

struct UvGrid {
    Mesh mesh;  // one material; not yet built
    GridStretch stretch;
    int cells_u = 0, cells_v = 0;              // before refinement
    int table_cells_u = 0, table_cells_v = 0;  // what the tables have
    DVec2 finest_cell = DVec2(1.0);            // after refinement, in u and v

    bool isCoarserThanTables() const {
        return finest_cell.x * table_cells_u > 1.0 + 1e-9 ||
               finest_cell.y * table_cells_v > 1.0 + 1e-9;
    }
};

// The surface with its tables, for any u and v. params must outlive it.
class DisplacedSurface {
public:
    // footprint: of a lookup in u and v.
    DisplacedSurface(const UvGridParams& params, DVec2 footprint);

    DVec3 base(double u, double v) const { return info_.at(params_.shape, u, v).position; }
    DVec3 position(double u, double v) const;
    // From differences half a footprint to all sides, as `tangent`, the way u goes. Unit both.
    DVec3 normal(double u, double v, DVec3& tangent) const;
    const GridSurfaceInfo& info() const { return info_; }

private:
    DVec3 offset(const GridPlace& place, double u, double v) const;
    DVec3 crossDifference(double u, double v, DVec3& along_u) const;
    bool isPole(double v) const { return (v <= 0.0 && pole_bottom_) || (v >= 1.0 && pole_top_); }

    const UvGridParams& params_;
    const GridSurfaceInfo& info_;
    DVec2 footprint_;
    bool pole_bottom_ = false, pole_top_ = false;  // all of u is one point there
};

// Throws kInvalidArgument. The same for any number of threads. Where the tables are finer than the
// grid and there is no normal map, the mesh has tangents, and a second layer of texture
// coordinates, without repeats, for makeDetailNormals().
UvGrid makeUvGrid(const UvGridParams& params, ThreadPool& pool);

// Texels of makeDetailNormals(): those of the tables, kMostDetail along a side at most.
glm::ivec2 detailSize(const UvGrid& grid);
inline constexpr int kMostDetail = 4096;

// What the tables say beyond the grid's resolution, as a normal map (tangent space, as glTF has
// it).
Texture makeDetailNormals(const UvGridParams& params, const UvGrid& grid, ThreadPool& pool);

}  // namespace stipple
