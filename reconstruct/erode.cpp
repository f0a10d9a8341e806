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

}  // namespace stipple
