// SPDX-License-Identifier: Apache-2.0
// Smooth random functions of place (gradient noise): pure functions of a key and a position.
// Based on: Perlin. Improving Noise. 2002.
#pragma once

#include <core/math.h>

#include <cstdint>

namespace stipple {

struct NoiseSample {
    double value = 0.0;             // in [-1, 1], mean 0, symmetric
    DVec2 derivative = DVec2(0.0);  // of value by position
};

// Gradient noise of wavelength about 1 over the plane. Positions up to 2^31 from the origin. About
// 20 ns.
NoiseSample gradientNoise(uint64_t key, const DVec2& p);
// The same in space, value only, in [-1, 1].
double gradientNoise(uint64_t key, const DVec3& p);

// Sum of octaves, each of half the wavelength and half the height of the one before; in [-2, 2],
// mostly within [-0.8, 0.8].
double fractalNoise(uint64_t key, const DVec2& p, int octaves);
double fractalNoise(uint64_t key, const DVec3& p, int octaves);

inline double smoothStep(double edge0, double edge1, double x) {
    const double t = std::clamp((x - edge0) / (edge1 - edge0), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

}  // namespace stipple
