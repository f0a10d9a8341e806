// SPDX-License-Identifier: Apache-2.0
// From splats to a model that can be drawn and written.
#pragma once

#include <scenegraph/io/splat_grow.h>
#include <scenegraph/surfel_model.h>

#include <vector>

namespace stipple {

// splats: relative to `middle`, at least one. bounds, area: of what they stand for. kept: gets, one
// a splat, its surfel as the model has it, but relative to `middle`; may be null. O(n log n).
SurfelModel packSplats(const std::vector<Splat>& splats, const std::vector<SurfelFinish>& finishes,
                       const DVec3& middle, const Box3& bounds, double area,
                       std::vector<Surfel>* kept = nullptr);

// Of the surface that a point stands for, about, m^2; its spacing is known.
inline double areaOf(const SplatPoint& p) {
    return kPi * 0.25 * double(p.spacing) * double(p.spacing);
}

}  // namespace stipple
