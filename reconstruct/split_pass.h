// SPDX-License-Identifier: Apache-2.0
// The depth pass of reconstructions that close large surfaces themselves: points on those cover a
// square, or just the subpixel they lie in, points on smaller patches what footprint.h says.
#pragma once

#include <reconstruct/depth_pass.h>

#include <array>
#include <cmath>

namespace stipple {

// 1 for patchWidthCode()s of at least that many subpixels.
inline std::array<uint8_t, kWidthCodes> codesFromWidth(float width) {
    std::array<uint8_t, kWidthCodes> is_wide{};
    for (int code = 1; code < kWidthCodes; ++code) {
        is_wide[size_t(code)] = std::exp2(float(code) / float(kWidthsPerOctave) +
                                          float(kFirstSubpixelExponent)) >= width;
    }
    return is_wide;
}

class SplitPass {
public:
    // is_wide: by patchWidthCode(), 1 where the patch is a large surface. side: of the square that
    // its points cover, subpixels.
    SplitPass(const ReconstructionContext& context, const std::array<uint8_t, kWidthCodes>& is_wide,
              int side)
        : is_wide_(is_wide), patch_pass_(context, 0), wide_pass_(context, side) {}

    void begin(const SubpixelRect& inner) {
        patch_pass_.begin(inner);
        wide_pass_.begin(inner);
    }
    bool isWide(const PointBlock& block, int i) const {
        return block.is_coarse || is_wide_[block.width[i]];
    }
    struct Taken {
        int wide;      // points of the block on large surfaces
        bool is_used;  // some point is in front
    };
    // Points on patches go into one tile, those on large surfaces into the other (or the same).
    Taken take(const PointBlock& block, DepthTile& patches, DepthTile& surfaces) {
        int wide = 0;
        bool is_used = false;
        for (int i = 0; i < block.count; ++i) wide += isWide(block, i);
        if (wide == 0) {
            is_used = patch_pass_.take(block, patches);
        } else if (wide == block.count) {
            is_used = wide_pass_.take(block, surfaces);
        } else {
            part_ = block;
            for (const uint8_t part : {0, 1}) {
                for (int i = 0; i < block.count; ++i)
                    part_.keep[i] = block.keep[i] & uint8_t(is_wide_[block.width[i]] == part);
                is_used |=
                    part ? wide_pass_.take(part_, surfaces) : patch_pass_.take(part_, patches);
            }
            twice_drawn_ += uint64_t(block.count);
        }
        return {wide, is_used};
    }
    bool take(const TriangleBlock& block, DepthTile& tile) { return patch_pass_.take(block, tile); }
    int reach(bool narrow) const {
        return narrow ? 0 : std::max(patch_pass_.reach(false), wide_pass_.reach(false));
    }
    TileCounters counters() const {
        TileCounters sum = patch_pass_.counters();
        sum.points_drawn += wide_pass_.counters().points_drawn - twice_drawn_;
        sum.points_kept += wide_pass_.counters().points_kept;
        return sum;
    }
    void addCount(int px, int py, PixelSums& sums) const {
        patch_pass_.addCount(px, py, sums);
        wide_pass_.addCount(px, py, sums);
    }

private:
    const std::array<uint8_t, kWidthCodes> is_wide_;
    DepthPass patch_pass_, wide_pass_;
    PointBlock part_;
    uint64_t twice_drawn_ = 0;
};

}  // namespace stipple
