// SPDX-License-Identifier: Apache-2.0
// FLIP: how much a viewer who flips between two pictures sees change, per pixel.
// Based on: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild. FLIP: A Difference
// Evaluator for Alternating Images. 2020.
#pragma once

#include <core/image.h>
#include <core/parallel.h>

#include <vector>

namespace stipple {

// The distance at which the measure looks: 0.7 m from a 0.7 m wide screen of 3840 pixels.
inline constexpr float kFlipPixelsPerDegree = 67.0f;

// Error in [0, 1] for every pixel, 0 where nothing changed. a, b: the same size, three channels,
// linear sRGB primaries in [0, 1]. The same bits for any number of threads. About 0.3 core seconds
// a million pixels.
std::vector<float> flipMap(const Image& a, const Image& b, float pixels_per_degree,
                           ThreadPool& pool);

}  // namespace stipple
