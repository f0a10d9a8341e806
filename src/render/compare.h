// SPDX-License-Identifier: Apache-2.0
// Measures of how two pictures differ, the same everywhere: compare, bench, study, tests.
#pragma once

#include <core/image.h>
#include <core/parallel.h>

#include <cstdint>
#include <optional>

namespace stipple {

// Pixels in which the reference sees surface in all its rays, but the picture shows less than half
// a surface or one that lies well behind.
struct HoleCount {
    uint64_t count = 0;
    double fraction = 0.0;  // of all pixels
};

// PSNR and RMSE: RGB, linear values clipped to [0, 1] (NaN is 0), then sRGB-encoded; peak 1.
struct CompareResult {
    uint64_t pixels = 0;
    double rmse = 0.0;
    double psnr = 0.0;  // dB; infinite for equal pictures
    double flip = 0.0;  // mean over the pixels, 0 .. 1; see flip.h
    std::optional<HoleCount>
        holes;  // only if a has channels coverage and depth, b coverage and depth_max
};

// image: what is judged; reference: usually ray-cast, whose depth_max is the largest depth over a
// pixel's rays. Both linear; channels R, G, B, or grey in the first channel. Throws
// kInvalidArgument if the sizes differ or are zero.
CompareResult compareImages(const Image& image, const Image& reference, ThreadPool& pool);

// A picture of the FLIP error: black where nothing differs, then red, yellow, white; holes in cyan.
// Throws as above.
Image differenceImage(const Image& image, const Image& reference, ThreadPool& pool);

// Differences of mean luminance, relative to the reference's, over tiles of 32 x 32 pixels (cut off
// at the right and the bottom) in which the reference's mean is above 0.02. Linear, not clipped.
struct TileMeans {
    uint64_t tiles = 0;  // that are bright enough
    double mean = 0.0;   // signed: a bias
    double rms = 0.0;
    double max = 0.0;  // largest absolute value
};
TileMeans tileMeans(const Image& image, const Image& reference);

}  // namespace stipple
