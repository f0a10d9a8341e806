// SPDX-License-Identifier: Apache-2.0
// Counter-based random numbers: every number is a pure function of its key, so any thread may draw
// any point in any order and a picture has the same bits for any number of threads.
#pragma once

#include <cstdint>

namespace stipple {

// Mixes 64 bits so that every input bit changes every output bit with probability 1/2.
// This work is based on: Steele, Lea, Flood. Fast Splittable Pseudorandom Number Generators. 2014
// (finalizer, variant 13).
inline uint64_t mixBits(uint64_t v) {
    v ^= v >> 30;
    v *= 0xbf58476d1ce4e5b9ull;
    v ^= v >> 27;
    v *= 0x94d049bb133111ebull;
    v ^= v >> 31;
    return v;
}

// The same in 32 bits, for vector loops: a cheap integer hash with good avalanche (low bias).
inline uint32_t mixBits32(uint32_t v) {
    v ^= v >> 16;
    v *= 0x7feb352du;
    v ^= v >> 15;
    v *= 0x846ca68bu;
    return v ^ v >> 16;
}

inline uint64_t hashCombine(uint64_t key, uint64_t value) {
    return mixBits(key * 0x9e3779b97f4a7c15ull + value + 0x632be59bd9b4e019ull);
}
template <class... Rest>
inline uint64_t hashCombine(uint64_t key, uint64_t value, Rest... rest) {
    return hashCombine(hashCombine(key, value), uint64_t(rest)...);
}

// Uniform in [0, 1), from the high bits of a hash.
inline double uniformDouble(uint64_t hash) { return double(hash >> 11) * 0x1p-53; }
inline float uniformFloat(uint64_t hash) { return float(uint32_t(hash >> 40)) * 0x1p-24f; }

// A stream for sequential code (generators): state is (key, counter).
struct Rng {
    uint64_t key = 0;
    uint64_t counter = 0;

    uint64_t next() { return hashCombine(key, counter++); }
    double uniform() { return uniformDouble(next()); }
    double uniform(double lo, double hi) { return lo + (hi - lo) * uniform(); }
};

// An integer whose expectation is x (x >= 0): floor(x) or floor(x) + 1.
inline uint64_t roundAtRandom(double x, uint64_t hash) {
    const double whole = double(uint64_t(x));
    return uint64_t(whole) + (uniformDouble(hash) < x - whole ? 1 : 0);
}

inline uint32_t reverseBits(uint32_t v) {
    v = (v >> 16) | (v << 16);
    v = ((v & 0x00ff00ffu) << 8) | ((v & 0xff00ff00u) >> 8);
    v = ((v & 0x0f0f0f0fu) << 4) | ((v & 0xf0f0f0f0u) >> 4);
    v = ((v & 0x33333333u) << 2) | ((v & 0xccccccccu) >> 2);
    return ((v & 0x55555555u) << 1) | ((v & 0xaaaaaaaau) >> 1);
}

}  // namespace stipple
