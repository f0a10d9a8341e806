// SPDX-License-Identifier: Apache-2.0
// How many subpixels a point covers.
#pragma once

#include <algorithm>

namespace stipple {

// Probability that a point covers the 2 x 2 subpixels around it instead of the one it lies in, so that a patch of that diameter
// (subpixels) drawn with k points per subpixel has, in expectation, the right coverage: too few points leave holes in patches
// of several subpixels. 1 for large smooth surfaces, whose silhouette grows by half a subpixel in exchange.
inline float wideFootprintShare(float patch, float k) {
    return std::clamp((patch - 1.0f) * 0.25f, 0.0f, 1.0f) * std::clamp((6.0f - k) * 0.25f, 0.0f, 1.0f);
}

}  // namespace stipple
