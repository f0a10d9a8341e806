// SPDX-License-Identifier: Apache-2.0
// Hierarchical depth buffers of a tile: level l has cells of 2^l x 2^l subpixels. A point goes into
// the level at which its surface has no gaps, and how far the levels cover a subpixel says whether
// what it shows lies behind a surface, seen through a hole.
// Based on: Grossman. Point Sample Rendering. MIT MSc thesis, 1998, sections 4.5, 4.6.
#pragma once

#include <core/camera.h>
#include <core/settings.h>
#include <reconstruct/depth_tile.h>

#include <array>
#include <vector>

namespace stipple {

// The level at which random points, k of them a subpixel, leave one cell in 10^4 empty:
// 4^level k >= 9. 0 to kMostLevels.
inline constexpr int kMostLevels = 6;
int levelOfDensity(double k);

class LevelDepths {
public:
    // highest: the level of wide surfaces. threshold: a cell hides only what lies three of its
    // widths behind it (off: all that lies behind).
    LevelDepths(const View& view, int highest, PullPushCoverage coverage, bool threshold);

    int highest() const { return highest_; }
    // Depth that one surface gains over a subpixel, at most: metres per depth, or metres.
    float slope() const { return kSlope * per_subpixel_; }
    // Level of a point on a patch of that width: no cell is wider than half the patch, so leaves
    // hide nothing beside them.
    int levelOf(uint8_t width_code) const { return level_of_width_[width_code]; }

    // 1 where levelOf() is above 0.
    std::array<uint8_t, kWidthCodes> hasLevel() const;

    // Empty; cells lie on multiples of their width in the picture, and are wholly there: `rect` is
    // widened to them.
    void reset(const SubpixelRect& rect);
    // level: 1 to highest(); 0 for what leaves no gaps and only goes on with a surface of points.
    void add(int level, int x, int y, float depth) {
        for (int l = std::max(level, 1); l <= highest_; ++l) {
            Level& to = levels_[size_t(l - 1)];
            float& cell = (l == level ? to.native : to.finer)[to.index(x >> l, y >> l)];
            cell = std::min(cell, depth);
        }
    }
    // Call when all points are in and `hits` holds the nearest at each subpixel. k: points a
    // subpixel.
    void finish(const DepthTile& hits, double k);
    // How far [0, 1] the levels cover what lies at that depth at a subpixel's centre. A bilinear
    // mesh is wholly there but within a subpixel of where it is half there.
    float coverage(int x, int y, float depth) const;

    // True if all cells near the rectangle are in front of z_min, so that nothing there can change
    // the picture: neither be seen, nor cover what is.
    bool hides(const SubpixelRect& rect, float z_min) const;
    // hides() sees what was there at the last call.
    void refreshHidden();

private:
    // Neighbouring cells of one surface differ by no more than this many of their widths in depth.
    static constexpr float kSlope = 6.0f;

    struct Level {
        int x0 = 0, y0 = 0, width = 0, height = 0;  // in cells
        // Nearest depth of points of this level, and of points of finer ones.
        std::vector<float> native, finer;
        std::vector<float> around;    // farthest depth of a cell and its neighbours, of any points
        std::vector<float> solidity;  // [0, 1], of a cell at a silhouette
        std::vector<float> farthest;  // of 4 x 4 cells of `native`

        size_t index(int x, int y) const { return size_t(y - y0) * size_t(width) + size_t(x - x0); }
    };

    // Depth of a cell's surface, infinite where there is none.
    float surfaceAt(int l, int x, int y) const;
    float behind(float depth, int level) const {
        return threshold_ * float(1 << level) * (orthographic_ ? 1.0f : depth);
    }
    float corner(int l, int x, int y, float depth) const;

    const bool orthographic_, is_bilinear_;
    const int highest_;
    const float per_subpixel_;  // width of a subpixel, metres per depth, or metres
    const float threshold_;     // depth per depth, or metres, of three subpixels
    std::array<uint8_t, kWidthCodes> level_of_width_;
    std::vector<Level> levels_;  // level 1 first
};

}  // namespace stipple
