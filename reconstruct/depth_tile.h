// SPDX-License-Identifier: Apache-2.0
// The z-buffer of one tile: nearest depth and number of every subpixel, and what lies hidden behind
// it.
#pragma once

#include <core/points.h>
#include <core/raster_job.h>

#include <bit>
#include <vector>

namespace stipple {

class DepthTile {
public:
    // Depth in the high bits and number in the low ones: one comparison, and the same result in any
    // order.
    static constexpr uint64_t kEmpty = 0x7f800000ffffffffull;  // infinite depth, no number
    static uint64_t pack(float depth, uint32_t number) {
        return uint64_t(std::bit_cast<uint32_t>(depth)) << 32 | number;
    }
    static float depthOf(uint64_t key) { return std::bit_cast<float>(uint32_t(key >> 32)); }
    static uint32_t numberOf(uint64_t key) { return uint32_t(key); }

    // Empty, or with the depths of rasterized triangles (whose numbers get number_bit).
    void reset(const SubpixelRect& rect, const RasterTarget* base, uint32_t number_bit);
    const SubpixelRect& rect() const { return rect_; }
    // Indexed by the subpixel's x. Rows may be read and written kPadding keys beyond their end
    // (what is written there is lost).
    static constexpr int kPadding = 8;
    uint64_t* row(int y) {
        return keys_.data() + size_t(y - rect_.y0) * size_t(stride()) - rect_.x0;
    }
    const uint64_t* row(int y) const {
        return keys_.data() + size_t(y - rect_.y0) * size_t(stride()) - rect_.x0;
    }
    int stride() const { return rect_.width() + kPadding; }
    std::vector<uint64_t>& keys() { return keys_; }
    const std::vector<uint64_t>& keys() const { return keys_; }

    // True if every subpixel of `rect` is covered by something nearer than z_min, by what
    // refreshHidden() saw last.
    bool hides(const SubpixelRect& rect, float z_min) const {
        const int x0 = std::max(rect.x0, rect_.x0) - rect_.x0,
                  x1 = std::min(rect.x1, rect_.x1) - rect_.x0;
        const int y0 = std::max(rect.y0, rect_.y0) - rect_.y0,
                  y1 = std::min(rect.y1, rect_.y1) - rect_.y0;
        bool is_hidden = true;
        for (int by = y0 / kHiddenBlock; by * kHiddenBlock < y1 && is_hidden; ++by) {
            for (int bx = x0 / kHiddenBlock; bx * kHiddenBlock < x1 && is_hidden; ++bx) {
                is_hidden = farthest_[size_t(by) * size_t(blocks_x_) + size_t(bx)] < z_min;
            }
        }
        if (is_hidden || int64_t(x1 - x0) * (y1 - y0) > kSmallRect) return is_hidden;
        // Depths are not negative: keys are ordered as they are.
        const uint64_t limit = pack(z_min > 0.0f ? z_min : 0.0f, 0);
        // From the top, where what is far shows first.
        for (int y = y0; y < y1; ++y) {
            const uint64_t* keys = keys_.data() + size_t(y) * size_t(stride());
            // Four at a time, one branch.
            int x = x0;
            for (; x + 4 <= x1; x += 4) {
                if (bool(keys[x] >= limit) | bool(keys[x + 1] >= limit) |
                    bool(keys[x + 2] >= limit) | bool(keys[x + 3] >= limit))
                    return false;
            }
            for (; x < x1; ++x) {
                if (keys[x] >= limit) return false;
            }
        }
        return true;
    }
    // Farthest depth of each 16 x 16 block, infinite where not wholly covered.
    void refreshHidden();

private:
    static constexpr int kHiddenBlock = 16;
    static constexpr int64_t kSmallRect = 4096;  // subpixels

    SubpixelRect rect_;
    std::vector<uint64_t> keys_;
    int blocks_x_ = 0, blocks_y_ = 0;
    std::vector<float> farthest_;
};

// Key of point i of a block where it covers a subpixel at that depth: says whether the point lies
// on a surface whose holes are to be closed.
inline uint64_t pointKey(const PointBlock& block, int i, float depth) {
    const bool is_on_surface = block.is_on_surface || block.width[i] >= kSurfaceCode;
    const uint32_t surface = is_on_surface ? kSurfaceBit : 0;
    return DepthTile::pack(depth, block.number[i] | surface);
}

}  // namespace stipple
