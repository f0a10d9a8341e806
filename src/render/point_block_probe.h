// SPDX-License-Identifier: Apache-2.0
// What can be measured of a point-block model beside its pictures: how many of its blocks each test
// leaves out, and how long the tests and the warp take. Based on: Grossman. Point Sample Rendering.
// 1998, sections 6.2, 6.3 and 8.
#pragma once

#include <core/camera.h>
#include <core/parallel.h>
#include <core/settings.h>
#include <scenegraph/scene.h>
#include <scenegraph/surfel_model.h>

#include <vector>

namespace stipple {

// The model without cones, and with masks of so many directions: 128, as built, 32 (each the union
// of four), or 0 (none).
void limitVisibility(SurfelModel& model, bool with_cones, int mask_directions);

// Shares of a level's blocks that a view leaves out, 0..1.
struct CulledShares {
    double cone = 0.0, mask = 0.0, both = 0.0;  // by each alone; by one or the other
};

// The model stands as in its own file: object space is world space.
CulledShares culledShares(const SurfelModel& model, const SurfelLevel& level, const View& view);

// The same by masks alone as in the thesis: those of 2^n x 2^n parts of the screen, of the smallest
// of these, their unions and so on that holds the block.
double culledByScreen(const SurfelModel& model, const SurfelLevel& level, const View& view, int n);

struct WarpSeconds {
    double visibility = 0.0;  // cones and masks of all blocks of a level
    double warp = 0.0;        // from all blocks to points in camera space, visibility included
    uint64_t points = 0;      // that were warped
    size_t hidden_blocks = 0;
};

// The least of `repeats`, one thread, nothing left out as hidden by other points. scene: shows
// models of surfels.
WarpSeconds measureWarp(const Scene& scene, const SurfelModel& model, const SurfelLevel& level,
                        const View& view, const RenderSettings& settings, int repeats);

}  // namespace stipple
