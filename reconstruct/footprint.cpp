// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/footprint.h>

#include <algorithm>
#include <cmath>

namespace stipple {

Footprint makeFootprint(float width, float k) {
    Footprint footprint;
    const float density = balancedDensity(width);
    if (k < density) {
        // Too few points for footprints of one subpixel.
        const float at_one = std::max(0.0f, width - 0.6f) / (width + 8.5f);
        const float closing = at_one * (density - k) / std::max(density - 1.0f, 1e-3f);
        // Below one point a subpixel each must stand for more than the one it lies in.
        footprint.wide_share = std::min(1.0f, std::max(closing, (1.0f / k - 1.0f) / 3.0f));
        return footprint;
    }
    // k side^2 = balancedDensity(width / side); the left side grows with the side, the right side
    // falls.
    float low = 0.0f, high = 1.0f;
    for (int i = 0; i < 20; ++i) {
        const float side = 0.5f * (low + high);
        (k * side * side < balancedDensity(width / std::max(side, 1e-6f)) ? low : high) = side;
    }
    footprint.half_side = 0.5f * high;
    return footprint;
}

float balancedDensity(float width) {
    return 1.0f + 0.6f * std::log1p(0.45f * width) + 0.25f * std::max(0.0f, width - 16.0f);
}

FootprintTable::FootprintTable(float k) {
    for (int code = 0; code < kWidthCodes; ++code) {
        const float mantissa =
            1.0f + (float(code % kWidthsPerOctave) + 0.5f) / float(kWidthsPerOctave);
        const Footprint footprint =
            code == kNoPatch
                ? Footprint{0.5f / std::sqrt(std::max(k, 1.0f)), 0.0f}
                : makeFootprint(
                      std::ldexp(mantissa, kFirstSubpixelExponent + code / kWidthsPerOctave), k);
        half_side[size_t(code)] = footprint.half_side;
        wide_share[size_t(code)] = footprint.wide_share;
    }
}

}  // namespace stipple
