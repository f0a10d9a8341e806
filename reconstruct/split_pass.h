// SPDX-License-Identifier: Apache-2.0
// The depth pass of reconstructions that close large surfaces themselves: points on those hit the
// one subpixel they lie in, points on smaller patches cover what footprint.h says.
#pragma once

#include <reconstruct/depth_pass.h>

#include <array>

namespace stipple {

class SplitPass {
public:
    // is_wide: by patchWidthCode(), 1 where the patch is a large surface.
    SplitPass(const ReconstructionContext& context, const std::array<uint8_t, kWidthCodes>& is_wide)
        : is_wide_(is_wide), patch_pass_(context, 0), hit_pass_(context, 1) {}

    void begin(const SubpixelRect& inner) {
        patch_pass_.begin(inner);
        hit_pass_.begin(inner);
    }
    bool isWide(uint8_t width_code) const { return is_wide_[width_code]; }
    // Returns how many of the block's points lie on large surfaces.
    int take(const PointBlock& block, DepthTile& tile) {
        int wide = 0;
        for (int i = 0; i < block.count; ++i) wide += is_wide_[block.width[i]];
        if (wide == 0) {
            patch_pass_.take(block, tile);
        } else if (wide == block.count) {
            hit_pass_.take(block, tile);
        } else {
            for (const uint8_t part : {0, 1}) {
                part_ = block;
                for (int i = 0; i < block.count; ++i)
                    part_.keep[i] &= is_wide_[block.width[i]] == part;
                (part ? hit_pass_ : patch_pass_).take(part_, tile);
            }
            twice_drawn_ += uint64_t(block.count);
        }
        return wide;
    }
    bool take(const TriangleBlock& block, DepthTile& tile) { return patch_pass_.take(block, tile); }
    int reach(bool narrow) const { return patch_pass_.reach(narrow); }
    TileCounters counters() const {
        TileCounters sum = patch_pass_.counters();
        sum.points_drawn += hit_pass_.counters().points_drawn - twice_drawn_;
        sum.points_kept += hit_pass_.counters().points_kept;
        return sum;
    }
    void addCount(int px, int py, PixelSums& sums) const {
        patch_pass_.addCount(px, py, sums);
        hit_pass_.addCount(px, py, sums);
    }

private:
    const std::array<uint8_t, kWidthCodes> is_wide_;
    DepthPass patch_pass_, hit_pass_;
    PointBlock part_;
    uint64_t twice_drawn_ = 0;
};

}  // namespace stipple
