// SPDX-License-Identifier: Apache-2.0
// Numbers in [0, 1) that fill several dimensions evenly, for every beginning of the sequence. Based
// on: Sobol. On the Distribution of Points in a Cube. 1967, with the direction numbers of Joe, Kuo
// 2008; Burley. Practical Hash-based Owen Scrambling. 2020.
#pragma once

#include <core/rng.h>

#include <array>
#include <cstdint>

namespace stipple {

inline constexpr int kSobolDimensions = 8;

namespace detail {

struct SobolMatrices {
    uint32_t columns[kSobolDimensions][32];
};

constexpr SobolMatrices makeSobolMatrices() {
    struct Polynomial {
        int degree;
        uint32_t coefficients, first[5];
    };
    constexpr Polynomial kPolynomials[kSobolDimensions - 1] = {
        {1, 0, {1}},          {2, 1, {1, 3}},        {3, 1, {1, 3, 1}},       {3, 2, {1, 1, 1}},
        {4, 1, {1, 1, 3, 3}}, {4, 4, {1, 3, 5, 13}}, {5, 2, {1, 1, 5, 5, 17}}};
    SobolMatrices m{};
    for (int k = 0; k < 32; ++k) m.columns[0][k] = 0x80000000u >> k;
    for (int d = 1; d < kSobolDimensions; ++d) {
        const Polynomial& p = kPolynomials[d - 1];
        uint32_t* v = m.columns[d];
        for (int k = 0; k < 32; ++k) {
            if (k < p.degree) {
                v[k] = p.first[k] << (31 - k);
                continue;
            }
            v[k] = v[k - p.degree] ^ v[k - p.degree] >> p.degree;
            for (int j = 1; j < p.degree; ++j) {
                if (p.coefficients >> (p.degree - 1 - j) & 1) v[k] ^= v[k - j];
            }
        }
    }
    return m;
}

inline constexpr SobolMatrices kSobolMatrices = makeSobolMatrices();

}  // namespace detail

// Number `index` of a dimension, as a fraction of 2^32.
inline uint32_t sobol(int dimension, uint32_t index) {
    uint32_t x = 0;
    for (const uint32_t* column = detail::kSobolMatrices.columns[dimension]; index != 0;
         index >>= 1, ++column)
        x ^= index & 1 ? *column : 0;
    return x;
}

// Another sequence that is as even, for each seed.
inline uint32_t owenScrambled(uint32_t x, uint32_t seed) {
    x = reverseBits(x);
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reverseBits(x);
}

}  // namespace stipple
