// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/erode.h>

#include <algorithm>

namespace stipple {

void erodeSplats(DepthTile& tile, const std::function<int(float depth)>& reach,
                 std::vector<uint64_t>& scratch) {
    const int width = tile.rect().width(), height = tile.rect().height();
    const ptrdiff_t stride = tile.stride();
    std::vector<uint64_t>& keys = tile.keys();
    scratch = keys;
    // Depth is in the keys' high bits, so the largest key is the farthest. Along x, then along y;
    // each place looks as far as the splat that it shows reaches.
    const auto filter = [&](const uint64_t* from, uint64_t* to, int i, int count, ptrdiff_t step,
                            int r) {
        uint64_t farthest = *from;
        for (int k = -std::min(r, i); k <= std::min(r, count - 1 - i); ++k)
            farthest = std::max(farthest, from[k * step]);
        *to = farthest;
    };
    std::vector<int> reaches(size_t(width) * size_t(height), 0);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const uint64_t key = keys[size_t(y * stride + x)];
            if (key == DepthTile::kEmpty || DepthTile::numberOf(key) & kKindBits) continue;
            const int r = reach(DepthTile::depthOf(key));
            reaches[size_t(y) * size_t(width) + size_t(x)] = r;
            filter(&keys[size_t(y * stride + x)], &scratch[size_t(y * stride + x)], x, width, 1, r);
        }
    }
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const int r = reaches[size_t(y) * size_t(width) + size_t(x)];
            if (r == 0) continue;
            filter(&scratch[size_t(y * stride + x)], &keys[size_t(y * stride + x)], y, height,
                   stride, r);
        }
    }
}

}  // namespace stipple
