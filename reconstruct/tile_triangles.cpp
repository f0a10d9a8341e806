// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/tile_triangles.h>

#include <core/vector_clones.h>

#include <algorithm>
#include <cstring>

namespace stipple {

namespace {

// Floor and ceiling of values above -32768 without a call.
inline int floorToInt(float v) { return int(v + 32768.0f) - 32768; }
inline int ceilToInt(float v) { return 32768 - int(32768.0f - v); }

// Compiler vectors: any width of the machine's registers will do.
using Float8 = float __attribute__((vector_size(32)));
using Int8 = int32_t __attribute__((vector_size(32)));
using Long8 = int64_t __attribute__((vector_size(64)));
using Key8 = uint64_t __attribute__((vector_size(64)));
constexpr Float8 kCenters8 = {0.5f, 1.5f, 2.5f, 3.5f, 4.5f, 5.5f, 6.5f, 7.5f};

// A centre on a shared edge belongs to both triangles, rounding included: no gap between them.
constexpr float kInside = -1e-6f;

// The block's triangles in the picture: vertices, bounds of the centres they may cover, edges.
struct Projected {
    alignas(64) float x[3][kBlockPoints], y[3][kBlockPoints],
        q[3][kBlockPoints];  // q: 1/z, or z in orthographic views
    alignas(64) float inverse_area[kBlockPoints];
    alignas(64) int x0[kBlockPoints], x1[kBlockPoints], y0[kBlockPoints], y1[kBlockPoints];
    alignas(64) float z_min[kBlockPoints];
};

template <bool kOrthographic>
inline __attribute__((always_inline)) void projectBlock(const View& view,
                                                        const TriangleBlock& block,
                                                        const SubpixelRect& rect, Projected& p) {
    const float focal = float(view.focal), cx = float(view.center_x), cy = float(view.center_y);
    for (int k = 0; k < 3; ++k) {
        for (int i = 0; i < kBlockPoints; ++i) {
            const float q = kOrthographic ? block.z[k][i] : 1.0f / block.z[k][i];
            const float scale = kOrthographic ? focal : focal * q;
            p.x[k][i] = cx + block.x[k][i] * scale;
            p.y[k][i] = cy + block.y[k][i] * scale;
            p.q[k][i] = q;
        }
    }
    const float left = float(rect.x0), right = float(rect.x1), top = float(rect.y0),
                bottom = float(rect.y1);
    for (int i = 0; i < kBlockPoints; ++i) {
        const float x_lo = std::min(std::min(p.x[0][i], p.x[1][i]), p.x[2][i]);
        const float x_hi = std::max(std::max(p.x[0][i], p.x[1][i]), p.x[2][i]);
        const float y_lo = std::min(std::min(p.y[0][i], p.y[1][i]), p.y[2][i]);
        const float y_hi = std::max(std::max(p.y[0][i], p.y[1][i]), p.y[2][i]);
        // Clamped on both sides: what lies far outside would not fit into an integer. The limits
        // come first, so that lanes without a triangle, which may be no numbers, give a limit.
        p.x0[i] = ceilToInt(std::min(right, std::max(left, x_lo - 0.5f)));
        p.x1[i] = floorToInt(std::max(left - 1.0f, std::min(right - 1.0f, x_hi - 0.5f)));
        p.y0[i] = ceilToInt(std::min(bottom, std::max(top, y_lo - 0.5f)));
        p.y1[i] = floorToInt(std::max(top - 1.0f, std::min(bottom - 1.0f, y_hi - 0.5f)));
        const float area = (p.x[1][i] - p.x[0][i]) * (p.y[2][i] - p.y[0][i]) -
                           (p.y[1][i] - p.y[0][i]) * (p.x[2][i] - p.x[0][i]);
        p.inverse_area[i] = std::abs(area) > 0.0f ? 1.0f / area : 0.0f;  // 0 for NaN too
        p.z_min[i] = std::min(std::min(block.z[0][i], block.z[1][i]), block.z[2][i]);
    }
}

// Whether all corners lie before near_z or beyond the same side of the tile, in perspective.
bool misses(const View& view, const SubpixelRect& rect, const Vec3 (&corners)[3]) {
    const float cx = float(view.center_x), cy = float(view.center_y);
    const Vec3 sides[4] = {{view.focal, 0.0f, cx - float(rect.x0)},
                           {-view.focal, 0.0f, float(rect.x1) - cx},
                           {0.0f, view.focal, cy - float(rect.y0)},
                           {0.0f, -view.focal, float(rect.y1) - cy}};
    const auto areAllOutside = [&](const auto& isOutside) {
        return isOutside(corners[0]) && isOutside(corners[1]) && isOutside(corners[2]);
    };
    bool is_missed = areAllOutside([&](const Vec3& p) { return p.z < view.near_z; });
    for (const Vec3& side : sides)
        is_missed |= areAllOutside([&](const Vec3& p) { return glm::dot(side, p) < 0.0f; });
    return is_missed;
}

// A triangle that begins before near_z, in perspective: by rays through the centres, as its corners
// have no place in the picture. Based on: Olano, Greer. Triangle Scan Conversion using 2D
// Homogeneous Coordinates. 1997.
uint64_t rasterizeFromNear(const View& view, const TriangleBlock& block, int i, DepthTile& tile) {
    const Vec3 corners[3] = {block.vertex(0, i), block.vertex(1, i), block.vertex(2, i)};
    if (misses(view, tile.rect(), corners)) return 0;
    const Vec3 &a = corners[0], &b = corners[1], &c = corners[2];
    const Vec3 normal = glm::cross(b - a, c - a);
    const float height = glm::dot(normal, a);
    const Vec3 edges[3] = {glm::cross(b, c), glm::cross(c, a), glm::cross(a, b)};
    const uint32_t number = (block.first_number + uint32_t(i)) | (block.is_wide ? kSurfaceBit : 0);
    const SubpixelRect& rect = tile.rect();
    for (int y = rect.y0; y < rect.y1; ++y) {
        uint64_t* row = tile.row(y);
        for (int x = rect.x0; x < rect.x1; ++x) {
            const float sub_x = float(x) + 0.5f, sub_y = float(y) + 0.5f;
            Vec3 origin, direction;
            view.ray(sub_x, sub_y, origin, direction);
            const float depth = height / glm::dot(normal, direction);
            if (!(depth >= view.near_z && depth < kInfinity)) continue;
            // The share of each corner where the ray meets the plane.
            const float ua = glm::dot(edges[0], direction), ub = glm::dot(edges[1], direction),
                        uc = glm::dot(edges[2], direction), inverse = 1.0f / (ua + ub + uc);
            if (std::min(std::min(ua * inverse, ub * inverse), uc * inverse) < kInside) continue;
            const uint64_t key = DepthTile::pack(depth, number);
            if (key < row[x] && (!block.mask || block.mask->isSurface(i, sub_x, sub_y)))
                row[x] = key;
        }
    }
    return uint64_t(rect.width()) * uint64_t(rect.height());
}

template <bool kOrthographic>
inline __attribute__((always_inline)) uint64_t rasterize(const View& view,
                                                         const TriangleBlock& block,
                                                         DepthTile& tile) {
    Projected p;
    projectBlock<kOrthographic>(view, block, tile.rect(), p);
    uint64_t visited = 0;
    for (int i = 0; i < block.count; ++i) {
        if (!kOrthographic && p.z_min[i] < view.near_z) {
            visited += rasterizeFromNear(view, block, i, tile);
            continue;
        }
        const int x0 = p.x0[i], x1 = p.x1[i], y0 = p.y0[i], y1 = p.y1[i];
        const float inverse = p.inverse_area[i];
        if (x0 > x1 || y0 > y1 || inverse == 0.0f) continue;
        if (tile.hides({x0, y0, x1 + 1, y1 + 1}, p.z_min[i])) continue;
        visited += uint64_t(x1 - x0 + 1) * uint64_t(y1 - y0 + 1);
        // Barycentrics are affine in the picture; so is 1/z in perspective, and z in orthographic
        // views.
        const float ax = p.x[0][i], ay = p.y[0][i];
        const float ub_x = (p.y[2][i] - ay) * inverse, ub_y = -(p.x[2][i] - ax) * inverse;
        const float uc_x = -(p.y[1][i] - ay) * inverse, uc_y = (p.x[1][i] - ax) * inverse;
        const float q0 = p.q[0][i], dq1 = p.q[1][i] - q0, dq2 = p.q[2][i] - q0;
        const uint32_t number =
            (block.first_number + uint32_t(i)) | (block.is_wide ? kSurfaceBit : 0);
        for (int y = y0; y <= y1; ++y) {
            const float dy = float(y) + 0.5f - ay;
            const float ub_row = dy * ub_y, uc_row = dy * uc_y;
            uint64_t* row = tile.row(y);
            if (block.mask) {
                for (int x = x0; x <= x1; ++x) {
                    const float dx = float(x) + 0.5f - ax;
                    const float ub = dx * ub_x + ub_row, uc = dx * uc_x + uc_row,
                                ua = 1.0f - ub - uc;
                    if (std::min(std::min(ua, ub), uc) < kInside) continue;
                    const float value = q0 + dq1 * ub + dq2 * uc;
                    const uint64_t key =
                        DepthTile::pack(kOrthographic ? value : 1.0f / value, number);
                    if (key < row[x] && block.mask->isSurface(i, float(x) + 0.5f, float(y) + 0.5f))
                        row[x] = key;
                }
                continue;
            }
            // Eight at a time, without branches; those beyond x1 lie outside the triangle.
            for (int x = x0; x <= x1; x += 8) {
                const Float8 dx = kCenters8 + (float(x) - ax);
                const Float8 ub = dx * ub_x + ub_row, uc = dx * uc_x + uc_row, ua = 1.0f - ub - uc;
                const Float8 value = q0 + dq1 * ub + dq2 * uc;
                const Float8 depth = kOrthographic ? value : 1.0f / value;
                const Int8 is_inside = (ua >= kInside) & (ub >= kInside) & (uc >= kInside);
                const Key8 key =
                    __builtin_convertvector((Int8)depth, Key8) << 32 | uint64_t(number);
                Key8 old;
                std::memcpy(&old, row + x, sizeof old);
                const Long8 take = __builtin_convertvector(is_inside, Long8) & (key < old);
                const Key8 result = take ? key : old;
                std::memcpy(row + x, &result, sizeof result);
            }
        }
    }
    return visited;
}

}  // namespace

STIPPLE_VECTOR_CLONES uint64_t rasterizeTriangles(const View& view, const TriangleBlock& block,
                                                  DepthTile& tile) {
    return view.orthographic ? rasterize<true>(view, block, tile)
                             : rasterize<false>(view, block, tile);
}

}  // namespace stipple
