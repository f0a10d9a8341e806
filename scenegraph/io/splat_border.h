// SPDX-License-Identifier: Apache-2.0
// Where the points end, splats end: what is drawn of a splat is wider than its points lie apart and
// round, so at the border of a scan it would reach far beyond it. Lines cut that off.
#pragma once

#include <scenegraph/io/splat_grow.h>

namespace stipple {

// How far what is drawn of a splat lies from its centre, at most.
float drawnReach(const Splat& splat);

// Adds cuts to the splat where no point lies within what is drawn of it, as many as it may still
// have: lines 1.5 spacings beyond sides of the points' hull that take away most.
// O(m log m) of the m points within its reach.
void cutAtBorders(const PointIndex& index, Splat& splat);

}  // namespace stipple
