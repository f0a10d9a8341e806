// SPDX-License-Identifier: Apache-2.0
// Surface splats from point clouds: as few ellipses as cover all points within a tolerance, closed
// over the gaps between the points, and cut at creases and borders. Based on: Wu, Kobbelt.
// Optimized Sub-Sampling of Point Sets for Surface Splatting. 2004; Johnson. Point-based Graphics
// for Estimated Surfaces.
#pragma once

#include <core/parallel.h>
#include <scenegraph/io/splat_grow.h>
#include <scenegraph/scene.h>

#include <functional>
#include <string>

namespace stipple {

// step: one word for people; fraction: of the step, 0..1.
using BuildProgress = std::function<void(const char* step, double fraction)>;

struct SplatOptions {
    double tolerance = 0.1;         // of points from their splat, per cent of the bounds' diagonal
    double color_tolerance = 0.15;  // of points' colours from their splat's, 0..2 (sRGB, a channel)
    int neighbours = 12;            // that a point's plane is fitted to
    int points = 200000;            // taken on meshes; clouds are taken as they are
    bool are_circles = false;       // instead of ellipses along the principal curvatures
    bool has_cuts = true;           // lines that cut splats at creases and borders
    bool relax = true;              // leave splats out whose points others cover
    bool naive = false;             // one splat a point, for comparison
    uint64_t memory_limit_mb = 0;   // that building may take; 0: as LoadOptions
};

// Sets one option from text, as `stipple build --set` has it. Throws kInvalidArgument.
void applyOption(SplatOptions& options, const std::string& key, const std::string& value);

// diagonal: of the bounds, m.
SplatRules rulesOf(const SplatOptions& options, double diagonal);

struct SplatReport {
    double seconds = 0.0;
    uint64_t points = 0, splats = 0;
    uint64_t points_on_meshes = 0;  // of these; the others are a cloud's
    uint64_t same_places = 0;       // points left out: others lie at the very same places
    double largest_distance = 0.0, mean_distance = 0.0;  // of points from their splat, m
    double tolerance = 0.0;                              // m
};

// Of all that the scene's root shows: clouds by their points (normals are kept where the file has
// them, else estimated and turned the same way), meshes by points spread evenly over them. The same
// model for any number of threads. progress is told the step and how much of it is done; it may be
// called from any thread, one at a time. Throws kInvalidScene if there are no points, kUnsupported
// for more than 2^27, kOutOfMemory, kCancelled. O(n log n) for small tolerances.
SurfelModel buildSplats(const Scene& scene, const SplatOptions& options, ThreadPool& pool,
                        const CancelFlag& cancel, const BuildProgress& progress,
                        SplatReport& report);

}  // namespace stipple
