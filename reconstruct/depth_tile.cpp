// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/depth_tile.h>

#include <core/vector_clones.h>

namespace stipple {

void DepthTile::reset(const SubpixelRect& rect, const RasterTarget* base, uint32_t number_bit) {
    rect_ = rect;
    keys_.assign(size_t(stride()) * size_t(rect.height()), kEmpty);
    blocks_x_ = (rect.width() + kHiddenBlock - 1) / kHiddenBlock;
    blocks_y_ = (rect.height() + kHiddenBlock - 1) / kHiddenBlock;
    farthest_.assign(size_t(blocks_x_) * size_t(blocks_y_), kInfinity);
    if (!base) return;
    for (int y = rect.y0; y < rect.y1; ++y) {
        const size_t offset = size_t(y) * size_t(base->width);
        uint64_t* keys = row(y);
        for (int x = rect.x0; x < rect.x1; ++x) {
            const uint32_t number = base->number[offset + x];
            if (number != kNoNumber) keys[x] = pack(base->depth[offset + x], number | number_bit);
        }
    }
    refreshHidden();
}

STIPPLE_VECTOR_CLONES void DepthTile::refreshHidden() {
    std::fill(farthest_.begin(), farthest_.end(), 0.0f);
    for (int y = 0; y < rect_.height(); ++y) {
        const uint64_t* keys = keys_.data() + size_t(y) * size_t(stride());
        float* blocks = farthest_.data() + size_t(y / kHiddenBlock) * blocks_x_;
        for (int bx = 0; bx < blocks_x_; ++bx) {
            const int end = std::min((bx + 1) * kHiddenBlock, rect_.width());
            uint64_t largest = 0;
            for (int x = bx * kHiddenBlock; x < end; ++x) largest = std::max(largest, keys[x]);
            blocks[bx] = std::max(blocks[bx], depthOf(largest));
        }
    }
}

}  // namespace stipple
