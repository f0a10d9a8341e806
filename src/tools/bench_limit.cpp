// SPDX-License-Identifier: Apache-2.0
#include <core/rng.h>
#include <core/stopwatch.h>
#include <tools/bench_limit.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr size_t kPoints = size_t(1) << 21;  // a thread
constexpr int kPasses = 8;

}  // namespace

MachineLimit::MachineLimit(int tile_size, ThreadPool& pool)
    : pool_(pool), workers_(size_t(pool.threadCount())) {
    const uint64_t n_subpixels = uint64_t(tile_size) * uint64_t(tile_size);
    pool_.forEach(workers_.size(), [&](size_t w, int) {
        workers_[w].tile.resize(n_subpixels);
        workers_[w].points.resize(kPoints);
        for (size_t i = 0; i < kPoints; ++i) {
            const uint64_t h = hashCombine(w, i);
            workers_[w].points[i] = {mixBits(h), uint32_t((h >> 32) * n_subpixels >> 32),
                                     uint32_t(i)};
        }
    });
}

double MachineLimit::pointsPerSecond() {
    pool_.forEach(workers_.size(), [&](size_t w, int) {
        std::fill(workers_[w].tile.begin(), workers_[w].tile.end(), ~uint64_t(0));
    });
    const Stopwatch watch;
    pool_.forEach(workers_.size(), [&](size_t w, int) {
        uint64_t* const tile = workers_[w].tile.data();
        for (int pass = 0; pass < kPasses; ++pass) {
            // Every pass is nearer than the one before, so that each has updates.
            const uint64_t nearer = ~uint64_t(0) >> pass;
            for (const Point& p : workers_[w].points) {
                // No branch: the store costs less than a wrong guess.
                tile[p.subpixel] = std::min(tile[p.subpixel], p.key & nearer);
            }
        }
    });
    return double(kPoints) * kPasses * double(workers_.size()) / watch.seconds();
}

size_t MachineLimit::bufferBytes() const { return workers_[0].tile.size() * sizeof(uint64_t); }

}  // namespace stipple
