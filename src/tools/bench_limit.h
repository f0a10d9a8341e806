// SPDX-License-Identifier: Apache-2.0
// How fast points could be drawn at all here: a plain loop that streams 16-byte points and keeps
// the nearest in a buffer of a tile's size, on all threads.
#pragma once

#include <core/parallel.h>

#include <cstdint>
#include <vector>

namespace stipple {

class MachineLimit {
public:
    // tile_size: subpixels along a side; each thread has such a buffer of 8 bytes a subpixel. Takes
    // 32 MB a thread for the points, which no cache near a core holds.
    MachineLimit(int tile_size, ThreadPool& pool);

    // Measures once, for about a tenth of a second: points a second of all threads. Each point is
    // 16 bytes read in order, and 8 bytes updated at a random place.
    double pointsPerSecond();
    size_t bufferBytes() const;
    static constexpr double kBytesPerPoint = 24.0;

private:
    struct Point {
        uint64_t key;  // depth and number in one word
        uint32_t subpixel;
        uint32_t attribute;
    };
    static_assert(sizeof(Point) == 16);
    struct Worker {
        std::vector<Point> points;
        std::vector<uint64_t> tile;
    };

    ThreadPool& pool_;
    std::vector<Worker> workers_;
};

}  // namespace stipple
