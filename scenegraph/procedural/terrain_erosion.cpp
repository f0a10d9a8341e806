// SPDX-License-Identifier: Apache-2.0
// This work is based on:
// Cordonnier, Braun, Cani, Benes, Galin, Peytavie, Guerin. Large Scale Terrain Generation from
// Tectonic Uplift and Fluvial Erosion. 2016 (stream power law, solved implicitly from the outlets
// upwards).
// Barnes, Lehman, Mulla. Priority-Flood: An Optimal Depression-Filling and Watershed-Labeling
// Algorithm for Digital Elevation Models. 2014 (which way water leaves hollows).
#include <scenegraph/procedural/terrain_erosion.h>

#include <core/rng.h>

#include <algorithm>
#include <queue>

namespace stipple {

namespace {

constexpr int kMostSamples = 257;
constexpr int kRounds = 12;
constexpr double kTalus = 0.8;  // steepest slope of loose rock

struct Grid {
    int n = 0;
    double step = 1.0;  // metres
    std::vector<double> height;

    double at(int i, int j) const {
        return height[size_t(std::clamp(j, 0, n - 1)) * size_t(n) +
                      size_t(std::clamp(i, 0, n - 1))];
    }
};

// Uniform cubic B-spline through the neighbourhood of (u, v), in samples: smooth, without facets.
double smoothAt(const Grid& grid, double u, double v) {
    const int i = int(u), j = int(v);
    const auto weights = [](double t, double(&w)[4]) {
        const double s = 1.0 - t;
        w[0] = s * s * s / 6.0;
        w[1] = (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0;
        w[2] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0;
        w[3] = t * t * t / 6.0;
    };
    double wu[4], wv[4], sum = 0.0;
    weights(u - i, wu);
    weights(v - j, wv);
    for (int b = 0; b < 4; ++b) {
        double row = 0.0;
        for (int a = 0; a < 4; ++a) row += wu[a] * grid.at(i + a - 1, j + b - 1);
        sum += wv[b] * row;
    }
    return sum;
}

struct Drainage {
    std::vector<uint32_t> order;     // cells, outlets first, each after the one it drains into
    std::vector<uint32_t> receiver;  // itself: an outlet
};

Drainage drain(const Grid& grid, double water_level) {
    const size_t n = size_t(grid.n), count = n * n;
    Drainage result;
    result.order.reserve(count);
    result.receiver.assign(count, UINT32_MAX);
    using Entry = std::pair<double, uint32_t>;  // level of the water, cell
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
    for (size_t c = 0; c < count; ++c) {
        const size_t i = c % n, j = c / n;
        const bool border = i == 0 || j == 0 || i + 1 == n || j + 1 == n;
        if (!border && grid.height[c] >= water_level) continue;
        result.receiver[c] = uint32_t(c);
        open.push({grid.height[c], uint32_t(c)});
    }
    while (!open.empty()) {
        const auto [level, cell] = open.top();
        open.pop();
        result.order.push_back(cell);
        const int i = int(cell % n), j = int(cell / n);
        for (int d = 0; d < 9; ++d) {
            const int x = i + d % 3 - 1, y = j + d / 3 - 1;
            if (x < 0 || y < 0 || x >= grid.n || y >= grid.n) continue;
            const uint32_t next = uint32_t(y) * uint32_t(n) + uint32_t(x);
            if (result.receiver[next] != UINT32_MAX) continue;
            result.receiver[next] = cell;
            open.push({std::max(grid.height[next], level), next});
        }
    }
    return result;
}

// One round of rivers: O(n log n).
void cutValleys(Grid& grid, double rate, double water_level, uint64_t key) {
    const Drainage drainage = drain(grid, water_level);
    std::vector<double> area(grid.height.size(), grid.step * grid.step);
    for (size_t k = drainage.order.size(); k-- > 0;) {
        const uint32_t cell = drainage.order[k], into = drainage.receiver[cell];
        if (into != cell) area[into] += area[cell];
    }
    for (const uint32_t cell : drainage.order) {
        const uint32_t into = drainage.receiver[cell];
        if (into == cell) continue;
        // Rock is not everywhere as hard: rivers wind.
        const double hardness = 0.6 + 0.8 * uniformDouble(hashCombine(key, cell));
        const double k = rate * hardness * std::sqrt(area[cell]) / grid.step;
        grid.height[cell] = (grid.height[cell] + k * grid.height[into]) / (1.0 + k);
    }
}

void slideDown(Grid& grid) {
    const std::vector<double> before = grid.height;
    const size_t n = size_t(grid.n);
    const double most = kTalus * grid.step;
    for (size_t j = 0; j < n; ++j) {
        for (size_t i = 0; i < n; ++i) {
            const size_t c = j * n + i;
            const auto slide = [&](size_t other) {
                const double excess = std::abs(before[c] - before[other]) - most;
                if (excess <= 0.0) return;
                const double moved = 0.2 * excess * (before[c] > before[other] ? 1.0 : -1.0);
                grid.height[c] -= moved;
                grid.height[other] += moved;
            };
            if (i + 1 < n) slide(c + 1);
            if (j + 1 < n) slide(c + n);
        }
    }
}

}  // namespace

void erode(HeightField& field, double strength, double water_level, uint64_t seed) {
    const int n = field.columns;
    Grid before;
    before.n = std::min(n, kMostSamples);
    before.step = field.size.x / double(before.n - 1);
    before.height.resize(size_t(before.n) * size_t(before.n));
    for (int j = 0; j < before.n; ++j) {
        for (int i = 0; i < before.n; ++i) {
            before.height[size_t(j) * size_t(before.n) + size_t(i)] = field.height(
                -0.5 * field.size.x + i * before.step, -0.5 * field.size.x + j * before.step);
        }
    }
    Grid after = before;
    for (int round = 0; round < kRounds; ++round) {
        cutValleys(after, 0.01 * strength, water_level, hashCombine(seed, 0xe40d));
        slideDown(after);
    }
    Grid change = after;
    for (size_t c = 0; c < change.height.size(); ++c) change.height[c] -= before.height[c];
    const double scale = double(before.n - 1) / double(n - 1);
    for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
            float& h = field.heights[size_t(j) * size_t(n) + size_t(i)];
            if (double(h) >= water_level || water_level <= 0.0)
                h += float(smoothAt(change, i * scale, j * scale));
        }
    }
}

}  // namespace stipple
