// SPDX-License-Identifier: Apache-2.0
// Parametric surfaces over u and v in [0, 1]: what grids are before tables move their points.
#pragma once

#include <core/math.h>

#include <string>
#include <vector>

namespace stipple {

// Lengths in metres. Which numbers count for which surface: gridSurfaces().
struct GridShape {
    std::string surface = "plane";
    DVec2 size = DVec2(1.0);  // along x and z
    double radius = 0.5;
    double top_radius = 0.0;
    double waist = 0.25;  // radius of a hyperboloid's middle
    double tube = 0.15;   // radius of a torus' tube
    double height = 1.0;
    double turns = 1.0;
};

// Seen from the front, u grows to the right and v upwards.
struct GridPlace {
    DVec3 position = DVec3(0.0);
    DVec3 tangent = DVec3(0.0);  // unit, the way u goes, at poles too
    DVec3 normal = DVec3(0.0);   // unit, of the front
};

struct GridSurfaceInfo {
    std::string name;
    GridPlace (*at)(const GridShape& shape, double u, double v);
    bool is_closed_u, is_closed_v;  // goes on at 0 where it ends at 1
    bool is_curved_u, is_curved_v;  // needs many cells even without a table
    std::vector<std::string> keys;  // the numbers of GridShape that it depends on
};

const std::vector<GridSurfaceInfo>& gridSurfaces();
// Throws kInvalidArgument.
const GridSurfaceInfo& gridSurface(const std::string& name);

}  // namespace stipple
