// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/noise.h>

#include <core/rng.h>

namespace stipple {

namespace {

// One hash a lattice point; its top bits choose the gradient.
uint64_t latticeHash(uint64_t key, int64_t x, int64_t y, int64_t z) {
    return mixBits(key ^
                   (uint64_t(x) * 0x9e3779b97f4a7c15ull + uint64_t(y) * 0xc2b2ae3d27d4eb4full +
                    uint64_t(z) * 0x165667b19e3779f9ull));
}

// Unit vectors every 22.5 degrees.
constexpr double kA = 0.92387953251128674, kB = 0.38268343236508978, kD = 0.70710678118654752;
constexpr double kGradients2[16][2] = {
    {1, 0},  {kA, kB},   {kD, kD},   {kB, kA},   {0, 1},  {-kB, kA}, {-kD, kD}, {-kA, kB},
    {-1, 0}, {-kA, -kB}, {-kD, -kD}, {-kB, -kA}, {0, -1}, {kB, -kA}, {kD, -kD}, {kA, -kB}};
// To the middles of a cube's edges, and the corners of a tetrahedron among them once more.
constexpr double kGradients3[16][3] = {{kD, kD, 0}, {-kD, kD, 0}, {kD, -kD, 0}, {-kD, -kD, 0},
                                       {kD, 0, kD}, {-kD, 0, kD}, {kD, 0, -kD}, {-kD, 0, -kD},
                                       {0, kD, kD}, {0, -kD, kD}, {0, kD, -kD}, {0, -kD, -kD},
                                       {kD, kD, 0}, {-kD, kD, 0}, {0, -kD, kD}, {0, -kD, -kD}};

const double (&latticeGradient(uint64_t key, int64_t x, int64_t y))[2] {
    return kGradients2[latticeHash(key, x, y, 0) >> 60];
}

DVec3 latticeGradient(uint64_t key, int64_t x, int64_t y, int64_t z) {
    const double(&g)[3] = kGradients3[latticeHash(key, x, y, z) >> 60];
    return DVec3(g[0], g[1], g[2]);
}

// Cheaper than std::floor where the instruction set has none.
int64_t floorToInt(double x) {
    const int64_t i = int64_t(x);
    return i - (x < double(i) ? 1 : 0);
}

double fade(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }
double fadeDerivative(double t) { return 30.0 * t * t * (t * (t - 2.0) + 1.0); }

constexpr double kScale2 = 1.4142135623730951;  // brings the extremes to +-1: sqrt(2) in the plane,
constexpr double kScale3 = 1.1547005383792515;  // 2 / sqrt(3) in space

}  // namespace

namespace {

template <bool kWithDerivative>
inline NoiseSample noise2(uint64_t key, const DVec2& p) {
    const int64_t ix = floorToInt(p.x), iy = floorToInt(p.y);
    const double x = p.x - double(ix), y = p.y - double(iy);
    const double(&g00)[2] = latticeGradient(key, ix, iy),
          (&g10)[2] = latticeGradient(key, ix + 1, iy);
    const double(&g01)[2] = latticeGradient(key, ix, iy + 1),
          (&g11)[2] = latticeGradient(key, ix + 1, iy + 1);
    const double v00 = g00[0] * x + g00[1] * y, v10 = g10[0] * (x - 1.0) + g10[1] * y;
    const double v01 = g01[0] * x + g01[1] * (y - 1.0),
                 v11 = g11[0] * (x - 1.0) + g11[1] * (y - 1.0);
    const double u = fade(x), v = fade(y), k = v00 - v10 - v01 + v11;
    NoiseSample s;
    s.value = kScale2 * (v00 + u * (v10 - v00) + v * (v01 - v00) + u * v * k);
    if constexpr (kWithDerivative) {
        const double du = fadeDerivative(x) * (v10 - v00 + v * k),
                     dv = fadeDerivative(y) * (v01 - v00 + u * k);
        for (int i = 0; i < 2; ++i) {
            const double blend = g00[i] + u * (g10[i] - g00[i]) + v * (g01[i] - g00[i]) +
                                 u * v * (g00[i] - g10[i] - g01[i] + g11[i]);
            s.derivative[i] = kScale2 * (blend + (i == 0 ? du : dv));
        }
    }
    return s;
}

}  // namespace

NoiseSample gradientNoise(uint64_t key, const DVec2& p) { return noise2<true>(key, p); }

double gradientNoise(uint64_t key, const DVec3& p) {
    const int64_t ix = floorToInt(p.x), iy = floorToInt(p.y), iz = floorToInt(p.z);
    const DVec3 t = p - DVec3(ix, iy, iz);
    double corner[8];
    for (int i = 0; i < 8; ++i) {
        const int dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
        corner[i] =
            glm::dot(latticeGradient(key, ix + dx, iy + dy, iz + dz), t - DVec3(dx, dy, dz));
    }
    const double u = fade(t.x), v = fade(t.y), w = fade(t.z);
    const auto mix = [](double a, double b, double s) { return a + s * (b - a); };
    const double low = mix(mix(corner[0], corner[1], u), mix(corner[2], corner[3], u), v);
    const double high = mix(mix(corner[4], corner[5], u), mix(corner[6], corner[7], u), v);
    return kScale3 * mix(low, high, w);
}

double fractalNoise(uint64_t key, const DVec2& p, int octaves) {
    double sum = 0.0, scale = 1.0;
    for (int i = 0; i < octaves; ++i, scale *= 2.0)
        sum += noise2<false>(key + uint64_t(i), p * scale).value / scale;
    return sum;
}

double fractalNoise(uint64_t key, const DVec3& p, int octaves) {
    double sum = 0.0, scale = 1.0;
    for (int i = 0; i < octaves; ++i, scale *= 2.0)
        sum += gradientNoise(key + uint64_t(i), p * scale) / scale;
    return sum;
}

}  // namespace stipple
