// SPDX-License-Identifier: Apache-2.0
// How many lines may cut a disc, wherever it is kept: as a splat, in a model and among points.
#pragma once

namespace stipple {

inline constexpr int kMostDiscCuts = 4;

}  // namespace stipple
