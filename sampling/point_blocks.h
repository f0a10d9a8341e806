// SPDX-License-Identifier: Apache-2.0
// Builds point-block models: the surface sampled by orthographic views from 32 directions, as many
// of the samples as leave no hole at unit magnification. Based on: Grossman. Point Sample
// Rendering. 1998, chapter 5 ("Model Building").
#pragma once

#include <core/material.h>
#include <core/parallel.h>
#include <core/raycaster.h>
#include <scenegraph/surfel_model.h>

#include <functional>
#include <string>

namespace stipple {

struct PointBlockOptions {
    int resolution = 256;  // pixels along the model's bounding sphere at unit magnification
    double tolerance_angle =
        25.0;                      // degrees: surfaces tilted less are adequately sampled by a view
    bool equilateral = true;       // lattice of equilateral triangles; else of squares
    int block_size = 8;            // samples along a side of what is chosen or left as a whole
    bool scored = true;            // well-lit angles first; else whatever comes first
    bool partial = true;           // leave single samples out that others make up for
    bool complete = true;          // add samples where no projection has left any near enough
    int directions = 32;           // of projections: 6 (axes), 32, or 128
    uint64_t memory_limit_mb = 0;  // that building may take; 0: as LoadOptions
};

// Sets one option from text, as `stipple build --set` has it. Throws kInvalidArgument.
void applyOption(PointBlockOptions& options, const std::string& key, const std::string& value);

// What a build did, for tables.
struct PointBlockReport {
    double seconds = 0.0;
    uint64_t rays = 0, samples_hit = 0;
    uint64_t samples_chosen = 0, samples_kept = 0;  // of the finest level
    double per_pixel = 0.0;  // samples kept per pixel of the surface at unit magnification
};

// Most memory that building takes, roughly: of a model that fills its bounding sphere's disc from
// everywhere.
double pointBlockBytes(const PointBlockOptions& options);

// caster: casts relative to `center`, the middle of `bounds` (both world space); the model is in
// world space. area: of the surface, m^2. patch_width: by material, of connected patches. The same
// model for any number of threads. progress may be called from any thread, one at a time. Throws
// kInvalidArgument, kCancelled.
SurfelModel buildPointBlocks(const RayCaster& caster, const std::vector<Material>& materials,
                             const std::vector<float>& patch_width, const DBox3& bounds,
                             double area, const PointBlockOptions& options, ThreadPool& pool,
                             const CancelFlag& cancel,
                             const std::function<void(double fraction)>& progress,
                             PointBlockReport& report);

}  // namespace stipple
