// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/uv_grid_table.h>

namespace stipple {

namespace {

int wrapTexel(int i, int n, bool repeats) {
    if (!repeats) return std::clamp(i, 0, n - 1);
    const int rest = i % n;
    return rest < 0 ? rest + n : rest;
}

// Four texels around a place along one side, and their weights.
struct Cubic {
    int first;
    double weight[4];
    explicit Cubic(double x) : first(int(std::floor(x)) - 1) {
        const double t = x - std::floor(x), t2 = t * t, t3 = t2 * t;
        weight[0] = 0.5 * (-t3 + 2.0 * t2 - t);
        weight[1] = 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0);
        weight[2] = 0.5 * (-3.0 * t3 + 4.0 * t2 + t);
        weight[3] = 0.5 * (t3 - t2);
    }
};

DVec3 sampleLevel(const GridTable::Level& level, DVec2 place, bool repeats_x, bool repeats_y) {
    const Cubic x(place.x * level.width - 0.5), y(place.y * level.height - 0.5);
    DVec3 sum(0.0);
    for (int j = 0; j < 4; ++j) {
        const int row = wrapTexel(y.first + j, level.height, repeats_y);
        for (int i = 0; i < 4; ++i) {
            const int column = wrapTexel(x.first + i, level.width, repeats_x);
            sum += DVec3(level.texels[size_t(row) * size_t(level.width) + size_t(column)]) *
                   (x.weight[i] * y.weight[j]);
        }
    }
    return sum;
}

// Half the size, rounded up: a texel is the mean of what it covers.
GridTable::Level halve(const GridTable::Level& fine) {
    GridTable::Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
    coarse.texels.resize(size_t(coarse.width) * size_t(coarse.height));
    const auto share = [](int i, int n_fine, int n_coarse, int texel) {
        const double ratio = double(n_fine) / n_coarse;
        return std::max(
            0.0,
            (std::min((i + 1) * ratio, texel + 1.0) - std::max(i * ratio, double(texel))) / ratio);
    };
    for (int y = 0; y < coarse.height; ++y) {
        for (int x = 0; x < coarse.width; ++x) {
            const int x0 = int(double(x) * fine.width / coarse.width),
                      y0 = int(double(y) * fine.height / coarse.height);
            DVec3 sum(0.0);
            for (int j = y0; j < std::min(y0 + 3, fine.height); ++j) {
                for (int i = x0; i < std::min(x0 + 3, fine.width); ++i) {
                    sum += DVec3(fine.texels[size_t(j) * size_t(fine.width) + size_t(i)]) *
                           (share(x, fine.width, coarse.width, i) *
                            share(y, fine.height, coarse.height, j));
                }
            }
            coarse.texels[size_t(y) * size_t(coarse.width) + size_t(x)] = Vec3(sum);
        }
    }
    return coarse;
}

}  // namespace

DVec3 GridTable::at(DVec2 place, DVec2 footprint, bool repeats_x, bool repeats_y) const {
    const double texels = std::max(footprint.x * levels[0].width, footprint.y * levels[0].height);
    const double level = std::clamp(std::log2(std::max(texels, 1.0)), 0.0, levels.size() - 1.0);
    const size_t below = size_t(level);
    const auto sample = [&](size_t l) {
        return sampleLevel(levels[l], place, repeats_x, repeats_y);
    };
    const double share = level - double(below);
    return share > 0.0 ? glm::mix(sample(below), sample(below + 1), share) : sample(below);
}

GridTable makeGridTable(int width, int height, std::vector<Vec3> texels) {
    GridTable table;
    table.levels.push_back({width, height, std::move(texels)});
    while (table.levels.back().width > 1 || table.levels.back().height > 1)
        table.levels.push_back(halve(table.levels.back()));
    return table;
}

}  // namespace stipple
