// SPDX-License-Identifier: Apache-2.0
// Rules that place many instances: scatter over a height field, grids. Pure functions of their
// parameters.
#pragma once

#include <scenegraph/instances.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/triangle_surface.h>

#include <array>
#include <vector>

namespace stipple {

struct ScatterItem {
    ChildRef child;
    double weight = 1.0;
};

// A picture of shares in [0, 1], seen from above (row 0 at the least z, column 0 at the least x).
struct DensityMap {
    int width = 0;
    int height = 0;
    std::vector<float> values;  // width * height

    // Between texels' centres linear, beyond the border the border's; u and v in [0, 1] along x, z.
    float at(double u, double v) const;
};

// What instances stand on. With neither: the plane y = 0.
struct ScatterSurface {
    const HeightField* field = nullptr;
    const TriangleSurface* triangles = nullptr;
};

// Places instances at random. On a height field and on the plane y = 0 a jittered grid's cells are
// filled at random, on triangles places are drawn evenly by area; either is thinned where slope,
// height, density or the neighbours forbid.
struct ScatterParams {
    std::vector<ScatterItem> items;
    // Wanted on the whole of the square (or the triangles), before limits. With spacing: the most.
    uint64_t count = 1000;
    DVec2 size = DVec2(100.0);  // metres, sides of the square along x and z (not for triangles)
    DVec2 center = DVec2(0.0);  // x, z of the square's centre
    double min_slope = 0.0, max_slope = 1.5707963267948966;  // radians
    double min_height = -1e9, max_height = 1e9;              // metres
    double min_scale = 0.8, max_scale = 1.2;
    double tilt = 0.0;        // largest random lean, radians
    double align = 0.0;       // 0: upright, 1: along the surface's normal
    double sink = 0.0;        // metres into the ground
    double clustering = 0.0;  // 0: even, 1: thickets and clearings (smooth noise of 60 m)
    double spacing =
        0.0;  // metres, least distance between any two; 0: none. (Poisson disc sampling)
    const DensityMap* density =
        nullptr;  // covers the square, or the triangles' bounds; may be null
    uint64_t seed = 1;
};
// The same instances, in the same order, for any number of threads. With spacing, up to
// scatterTries() places of 80 bytes are kept for a moment.
void scatter(const ScatterParams& params, const ScatterSurface& surface, ThreadPool& pool,
             InstanceStore& instances);
DBox3 scatterDomain(const ScatterParams& params, const ScatterSurface& surface);
// How many places are tried, and how many instances there can be at most (about, as surfaces fold).
double scatterTries(const ScatterParams& params, const ScatterSurface& surface);
double scatterMost(const ScatterParams& params, const ScatterSurface& surface);

// A grid of one child in the plane y = 0, each with an individual turn about y, offset, height and
// scale.
struct GridParams {
    ChildRef child;
    uint32_t count_x = 1, count_z = 1;
    double spacing_x = 1.0, spacing_z = 1.0;  // metres
    double jitter = 0.0;                      // metres, largest offset along x and z
    bool quarter_turns = false;               // turn by multiples of 90 degrees
    bool any_turn = false;                    // turn by any angle
    double min_scale = 1.0, max_scale = 1.0;
    double hill_height = 0.0;   // metres: height follows smooth noise ...
    double hill_size = 1000.0;  // ... of this wavelength
    uint64_t seed = 1;
};
void placeGrid(const GridParams& params, ThreadPool& pool, InstanceStore& instances);
DBox3 gridDomain(const GridParams& params);

}  // namespace stipple
