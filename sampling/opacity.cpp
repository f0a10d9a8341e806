// SPDX-License-Identifier: Apache-2.0
#include <sampling/opacity.h>

#include <algorithm>

namespace stipple {

float patchOpacity(float patch, float k) {
    // Density at which a square patch of that side covers, in expectation, as many subpixels as its area: where too few points
    // inside balance what the border gains.
    const float density = 1.0f + 0.45f * patch;
    return std::min(1.0f, density / k);
}

}  // namespace stipple
