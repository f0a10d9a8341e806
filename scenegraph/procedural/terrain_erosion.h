// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <scenegraph/procedural/generators.h>

namespace stipple {

// Cuts valleys into a height field, as rivers do over time: every place drains to the border or to
// what lies below `water_level` [m], and loses height with slope and the root of the area that
// drains through it; slopes steeper than loose rock holds slide down. strength: 0..1. Works on at
// most 257 x 257 samples and keeps finer detail. About 0.15 s.
void erode(HeightField& field, double strength, double water_level, uint64_t seed);

}  // namespace stipple
