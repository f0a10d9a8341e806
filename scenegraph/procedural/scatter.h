// SPDX-License-Identifier: Apache-2.0
// Rules that place many instances: scatter over a height field, grids. Pure functions of their
// parameters.
#pragma once

#include <scenegraph/instances.h>
#include <scenegraph/procedural/generators.h>

#include <array>
#include <vector>

namespace stipple {

struct ScatterItem {
    ChildRef child;
    double weight = 1.0;
};

// Places instances on a height field (or on the plane y = 0): a jittered grid whose cells are
// filled at random, so about `count` of them lie in the whole square, thinned where slope or height
// forbid.
struct ScatterParams {
    std::vector<ScatterItem> items;
    uint64_t count = 1000;      // wanted on the whole square, before limits
    double size = 100.0;        // metres, side of the square, centred on the origin
    DVec2 center = DVec2(0.0);  // x, z of the square's centre
    double min_slope = 0.0, max_slope = 1.5707963267948966;  // radians
    double min_height = -1e9, max_height = 1e9;              // metres
    double min_scale = 0.8, max_scale = 1.2;
    double tilt = 0.0;        // largest random lean, radians
    double align = 0.0;       // 0: upright, 1: along the surface's normal
    double sink = 0.0;        // metres into the ground
    double clustering = 0.0;  // 0: even, 1: thickets and clearings (smooth noise of 60 m)
    uint64_t seed = 1;
};
void scatter(const ScatterParams& params, const HeightField* field, InstanceStore& instances);
DBox3 scatterDomain(const ScatterParams& params, const HeightField* field);

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
void placeGrid(const GridParams& params, InstanceStore& instances);
DBox3 gridDomain(const GridParams& params);

}  // namespace stipple
