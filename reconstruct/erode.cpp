// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/erode.h>

#include <algorithm>

namespace stipple {

void erodeSplats(const DepthTile& tile, const std::function<int(float depth)>& reach,
                 std::vector<uint64_t>& eroded) {
    const int width = tile.rect().width(), height = tile.rect().height();
    const ptrdiff_t stride = tile.stride();
    const std::vector<uint64_t>& keys = tile.keys();
    std::vector<uint64_t> along_x = keys;
    eroded = keys;
    // Depth is in the keys' high bits, so the largest key is the farthest. Along x, then along y;
    // each place looks as far as the splat that it shows reaches.
    const auto farthest = [](const uint64_t* from, int i, int count, ptrdiff_t step, int r) {
        uint64_t key = *from;
        for (int k = -std::min(r, i); k <= std::min(r, count - 1 - i); ++k)
            key = std::max(key, from[k * step]);
        return key;
    };
    std::vector<int> reaches(keys.size(), 0);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const size_t i = size_t(y * stride + x);
            if (keys[i] == DepthTile::kEmpty || DepthTile::numberOf(keys[i]) & kAnyTriangle)
                continue;
            reaches[i] = reach(DepthTile::depthOf(keys[i]));
            along_x[i] = farthest(&keys[i], x, width, 1, reaches[i]);
        }
    }
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const size_t i = size_t(y * stride + x);
            if (reaches[i] > 0) eroded[i] = farthest(&along_x[i], y, height, stride, reaches[i]);
        }
    }
}

void farthestWithin(const DepthTile& tile, int reach, std::vector<uint64_t>& farthest) {
    const int width = tile.rect().width(), height = tile.rect().height();
    const size_t stride = size_t(tile.stride());
    std::vector<uint64_t> along_y(stride);
    farthest.assign(tile.keys().size(), 0);
    for (int y = 0; y < height; ++y) {
        std::fill(along_y.begin(), along_y.end(), 0);
        for (int ny = std::max(y - reach, 0); ny <= std::min(y + reach, height - 1); ++ny) {
            const uint64_t* row = tile.keys().data() + size_t(ny) * stride;
            for (int x = 0; x < width; ++x)
                along_y[size_t(x)] = std::max(along_y[size_t(x)], row[x]);
        }
        uint64_t* to = farthest.data() + size_t(y) * stride;
        for (int k = -reach; k <= reach; ++k) {
            for (int x = std::max(0, -k); x < std::min(width, width - k); ++x)
                to[x] = std::max(to[x], along_y[size_t(x + k)]);
        }
    }
}

}  // namespace stipple
