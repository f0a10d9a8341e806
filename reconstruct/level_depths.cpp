// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/level_depths.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

// hides() looks this many cells of the highest level around: what lies in a cell reaches one cell
// through the bilinear mesh and one more by making its neighbours' cells interior ones.
constexpr int kReachCells = 4;
constexpr int kBlock = 4;
// Where a mesh ends it fades over this many subpixels, however wide its cells are.
constexpr float kFadeWidth = 2.0f;

}  // namespace

int levelOfDensity(double k) {
    return std::clamp(int(std::ceil(0.5 * std::log2(9.0 / k) - 1e-9)), 0, kMostLevels);
}

LevelDepths::LevelDepths(const View& view, int highest, PullPushCoverage coverage, bool threshold)
    : orthographic_(view.orthographic),
      is_bilinear_(coverage == PullPushCoverage::kBilinear),
      highest_(highest),
      per_subpixel_(1.0f / float(view.focal)),
      threshold_(threshold ? 3.0f * per_subpixel_ : 0.0f),
      levels_(size_t(highest)) {
    for (int code = 0; code < kWidthCodes; ++code) {
        const int log_width = code / kWidthsPerOctave + kFirstSubpixelExponent;
        level_of_width_[size_t(code)] = uint8_t(std::clamp(log_width - 1, 0, highest));
    }
    level_of_width_[kNoPatch] = 0;
}

std::array<uint8_t, kWidthCodes> LevelDepths::hasLevel() const {
    std::array<uint8_t, kWidthCodes> has{};
    for (size_t code = 0; code < has.size(); ++code) has[code] = level_of_width_[code] > 0;
    return has;
}

void LevelDepths::reset(const SubpixelRect& rect) {
    for (int l = 1; l <= highest_; ++l) {
        Level& level = levels_[size_t(l - 1)];
        level.x0 = rect.x0 >> l;
        level.y0 = rect.y0 >> l;
        level.width = ((rect.x1 - 1) >> l) + 1 - level.x0;
        level.height = ((rect.y1 - 1) >> l) + 1 - level.y0;
        const size_t n = size_t(level.width) * size_t(level.height);
        level.native.assign(n, kInfinity);
        level.finer.assign(n, kInfinity);
        const size_t blocks = size_t((level.width + kBlock - 1) / kBlock) *
                              size_t((level.height + kBlock - 1) / kBlock);
        level.farthest.assign(blocks, kInfinity);
    }
}

// Where a surface passes from a level to a finer one, or to triangles, the meshes of both end at
// their last cells' centres, and neither covers what lies between: the coarse mesh goes on over one
// more cell, where finer points or triangles continue the surface.
float LevelDepths::surfaceAt(int l, int x, int y) const {
    const Level& level = levels_[size_t(l - 1)];
    const size_t i = level.index(x, y);
    const float depth = level.native[i], finer = level.finer[i];
    if (!(finer < depth)) return depth;
    const float step = slope() * float(1 << l) * (orthographic_ ? 1.0f : finer);
    for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
            const int nx = std::clamp(x + dx, level.x0, level.x0 + level.width - 1),
                      ny = std::clamp(y + dy, level.y0, level.y0 + level.height - 1);
            if (std::abs(level.native[level.index(nx, ny)] - finer) <= step) return finer;
        }
    }
    return depth;
}

void LevelDepths::finish(const DepthTile& hits, double k) {
    const SubpixelRect& rect = hits.rect();
    if (highest_ > 0) {
        for (int y = rect.y0; y < rect.y1; ++y) {
            const uint64_t* row = hits.row(y);
            for (int x = rect.x0; x < rect.x1; ++x) {
                const uint32_t number = DepthTile::numberOf(row[x]);
                if (number != kNoNumber && number & kAnyTriangle)
                    add(0, x, y, DepthTile::depthOf(row[x]));
            }
        }
    }
    // Share of the subpixels of a surface that are hit.
    const float hit_share = float(-std::expm1(-k));
    for (int l = 1; l <= highest_; ++l) {
        Level& level = levels_[size_t(l - 1)];
        std::vector<float> surface(level.native.size());
        for (int y = level.y0; y < level.y0 + level.height; ++y) {
            for (int x = level.x0; x < level.x0 + level.width; ++x)
                surface[level.index(x, y)] = surfaceAt(l, x, y);
        }
        level.native.swap(surface);
        level.around.assign(level.native.size(), 0.0f);
        for (int y = level.y0; y < level.y0 + level.height; ++y) {
            for (int x = level.x0; x < level.x0 + level.width; ++x) {
                float& around = level.around[level.index(x, y)];
                for (int ny = std::max(y - 1, level.y0);
                     ny < std::min(y + 2, level.y0 + level.height); ++ny) {
                    for (int nx = std::max(x - 1, level.x0);
                         nx < std::min(x + 2, level.x0 + level.width); ++nx)
                        around = std::max(around, std::min(level.native[level.index(nx, ny)],
                                                           level.finer[level.index(nx, ny)]));
                }
            }
        }
        level.solidity.assign(level.native.size(), 0.0f);
        for (int cy = level.y0; cy < level.y0 + level.height; ++cy) {
            for (int cx = level.x0; cx < level.x0 + level.width; ++cx) {
                const size_t i = level.index(cx, cy);
                const float depth = level.native[i];
                if (!(depth < kInfinity)) continue;
                const int x0 = std::max(cx << l, rect.x0), x1 = std::min((cx + 1) << l, rect.x1);
                const int y0 = std::max(cy << l, rect.y0), y1 = std::min((cy + 1) << l, rect.y1);
                const float limit = depth + std::max(behind(depth, l), 1e-3f * depth);
                int hit = 0;
                for (int y = y0; y < y1; ++y) {
                    const uint64_t* row = hits.row(y);
                    for (int x = x0; x < x1; ++x) hit += DepthTile::depthOf(row[x]) <= limit;
                }
                // The mesh is half there where a straight edge of the surface lies.
                const float share = float(hit) / (hit_share * float((x1 - x0) * (y1 - y0)));
                level.solidity[i] = share < 0.5f ? 2.0f * share / (1.0f + 2.0f * share)
                                                 : 0.5f / (1.5f - std::min(share, 1.0f));
            }
        }
    }
}

// Of the mesh of level l at a cell's centre: 1 within the surface, less where it ends.
float LevelDepths::corner(int l, int x, int y, float depth) const {
    const Level& level = levels_[size_t(l - 1)];
    x = std::clamp(x, level.x0, level.x0 + level.width - 1);
    y = std::clamp(y, level.y0, level.y0 + level.height - 1);
    const size_t i = level.index(x, y);
    const auto isInFront = [&](float cell) { return cell + behind(cell, l) < depth; };
    if (!isInFront(level.native[i])) return 0.0f;
    return isInFront(level.around[i]) ? 1.0f : level.solidity[i];
}

float LevelDepths::coverage(int x, int y, float depth) const {
    float sum = 0.0f;
    for (int l = 1; l <= highest_ && sum < 1.0f; ++l) {
        const Level& level = levels_[size_t(l - 1)];
        if (!is_bilinear_) {
            const float cell = level.native[level.index(x >> l, y >> l)];
            if (cell + behind(cell, l) < depth) return 1.0f;
            continue;
        }
        // Cells' centres are the vertices.
        const float size = float(1 << l);
        const float fx = (float(x) + 0.5f) / size - 0.5f, fy = (float(y) + 0.5f) / size - 0.5f;
        const int cx = int(std::floor(fx)), cy = int(std::floor(fy));
        const float tx = fx - float(cx), ty = fy - float(cy);
        const float top =
            (1.0f - tx) * corner(l, cx, cy, depth) + tx * corner(l, cx + 1, cy, depth);
        const float bottom =
            (1.0f - tx) * corner(l, cx, cy + 1, depth) + tx * corner(l, cx + 1, cy + 1, depth);
        const float mesh = (1.0f - ty) * top + ty * bottom;
        sum += std::clamp(0.5f + (mesh - 0.5f) * std::max(1.0f, size / kFadeWidth), 0.0f, 1.0f);
    }
    return std::min(sum, 1.0f);
}

bool LevelDepths::hides(const SubpixelRect& rect, float z_min) const {
    const int reach = kReachCells << highest_;
    for (int l = highest_; l >= 1; --l) {
        const Level& level = levels_[size_t(l - 1)];
        const float limit = (z_min - (orthographic_ ? threshold_ * float(1 << l) : 0.0f)) /
                            (1.0f + (orthographic_ ? 0.0f : threshold_ * float(1 << l)));
        const int x0 = std::max((rect.x0 - reach) >> l, level.x0) - level.x0,
                  x1 = std::min((rect.x1 - 1 + reach) >> l, level.x0 + level.width - 1) - level.x0;
        const int y0 = std::max((rect.y0 - reach) >> l, level.y0) - level.y0,
                  y1 = std::min((rect.y1 - 1 + reach) >> l, level.y0 + level.height - 1) - level.y0;
        const int blocks_x = (level.width + kBlock - 1) / kBlock;
        bool is_hidden = true;
        for (int by = y0 / kBlock; by <= y1 / kBlock && is_hidden; ++by) {
            for (int bx = x0 / kBlock; bx <= x1 / kBlock && is_hidden; ++bx)
                is_hidden =
                    level.farthest[size_t(by) * size_t(blocks_x) + size_t(bx)] * 1.0001f < limit;
        }
        if (is_hidden) return true;
    }
    return false;
}

void LevelDepths::refreshHidden() {
    for (Level& level : levels_) {
        const int blocks_x = (level.width + kBlock - 1) / kBlock;
        std::fill(level.farthest.begin(), level.farthest.end(), 0.0f);
        for (int y = 0; y < level.height; ++y) {
            for (int x = 0; x < level.width; ++x) {
                float& block =
                    level.farthest[size_t(y / kBlock) * size_t(blocks_x) + size_t(x / kBlock)];
                block = std::max(block, level.native[size_t(y) * size_t(level.width) + size_t(x)]);
            }
        }
    }
}

}  // namespace stipple
