// SPDX-License-Identifier: Apache-2.0
// Looks up and shades what a subpixel of a tile shows, or once for those of a pixel that show the
// same. Used by every reconstruction that keeps the nearest.
#pragma once

#include <core/ambient_visibility.h>
#include <core/light_visibility.h>
#include <reconstruct/depth_tile.h>
#include <reconstruct/reconstruction.h>

#include <array>
#include <bit>

namespace stipple {

// Light on a sample that stands for several places: the mean of what reaches them.
class LightOnPlaces : public LightVisibility, public AmbientVisibility {
public:
    static constexpr int kMost = 16;
    struct Place {
        Vec3 position_camera;
        float share;  // of all
    };
    LightOnPlaces(const LightVisibility* lights, const AmbientVisibility* ambient)
        : lights_(lights), ambient_(ambient) {}

    void set(const Place* places, int count) { places_ = places, count_ = count; }
    float ofSun(size_t sun, const SurfaceSample& sample) const override;
    float ofLamp(size_t lamp, const SurfaceSample& sample) const override;
    float of(const SurfaceSample& sample, const Vec3& normal_world) const override;

private:
    template <class Of>
    float mean(const SurfaceSample& sample, const Of& of) const;

    const LightVisibility* lights_;
    const AmbientVisibility* ambient_;
    const Place* places_ = nullptr;
    int count_ = 0;
};

class SubpixelShader {
public:
    explicit SubpixelShader(const ReconstructionContext& context)
        : context_(context), light_(context.light_visibility, context.ambient_visibility) {
        forget();
    }

    // Numbers mean something else in another tile.
    void forget() { varied_numbers_.fill(kNoNumber); }
    // Surface and radiance of a key that is not empty, seen at the centre of subpixel (x, y).
    void show(const SampleLookup& lookup, uint64_t key, int x, int y);
    // Calls take(x, y, key) for all subpixels of pixel (px, py) after surface and radiance have
    // been set, where the key is not empty: once for all that show the same point or triangle, seen
    // in their middle, within cells of kSharedCells^2 subpixels. Shadows and occlusion may fall
    // between them: they are asked for in cells half as wide, and no wider than half a pixel. There
    // all is, where there are projectors' pictures.
    // Once for each where there is a normal map: what is mirrored does not average as normals do.
    template <class Take>
    void showPixel(const SampleLookup& lookup, const DepthTile& tile, int px, int py,
                   const Take& take);
    // Has the memory read what pixel (px, py), if it is in the tile, will show.
    void readAhead(const SampleLookup& lookup, const DepthTile& tile, int px, int py) const;
    // Side of the squares of subpixels within which one look-up may do for all.
    int sharedSide() const {
        const int side = std::min(kSharedCells, context_.view.subpixels);
        return hasVariedLight() ? std::max(side / 2, 1) : side;
    }
    // Surface and radiance for so many subpixels around p_sub. False, and no
    // radiance, where there is a normal map.
    bool showShared(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                    const Vec2& p_sub, float count);
    // Surface and radiance of a point, whose position is known.
    void showPoint(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                   const Vec2& p_sub);
    // The surface alone, without its radiance.
    void lookUp(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                const Vec2& p_sub);
    const SurfaceSample& sample() const { return sample_; }
    const Vec3& radiance() const { return radiance_; }
    // Radiance of a surface that was put together elsewhere.
    Vec3 shadeSample(const SurfaceSample& sample) const;

private:
    static constexpr int kSharedCells = 4;
    struct Cell;
    template <class Take>
    void showCell(const SampleLookup& lookup, const Cell& cell, const Take& take);
    // Those of the members' cells half as wide that the first of them is in.
    uint32_t membersBeside(const Cell& cell, uint32_t members) const;
    // Whether light may fall between members.
    bool hasVariedLight() const;
    // The middle of members of one plane: in the picture, and in camera space.
    Vec3 middleOf(const Cell& cell, uint32_t members, Vec2& p_sub) const;
    // Surface and radiance in the middle of some members of a cell. False where their normals vary.
    bool showMembers(const SampleLookup& lookup, const Cell& cell, uint32_t members);

    const ReconstructionContext& context_;
    LightOnPlaces light_;
    // Triangles whose normals were found to vary, each at its number modulo kVaried.
    static constexpr uint32_t kVaried = 1024;
    std::array<uint32_t, kVaried> varied_numbers_;
    SurfaceSample sample_;
    Vec3 radiance_ = Vec3(0);
};

// Subpixels that may share a look-up.
struct SubpixelShader::Cell {
    static constexpr int kMost = kSharedCells * kSharedCells;
    int count = 0;
    uint32_t number[kMost];
    uint64_t key[kMost];
    int x[kMost], y[kMost];
};

template <class Take>
void SubpixelShader::showPixel(const SampleLookup& lookup, const DepthTile& tile, int px, int py,
                               const Take& take) {
    const int s = context_.view.subpixels;
    readAhead(lookup, tile, px + 2, py);
    if (s == 1) {
        const uint64_t key = tile.row(py)[px];
        if (DepthTile::numberOf(key) != kNoNumber) show(lookup, key, px, py);
        take(px, py, key);
        return;
    }
    Cell cell;
    for (int top = py * s; top < (py + 1) * s; top += kSharedCells) {
        for (int left = px * s; left < (px + 1) * s; left += kSharedCells) {
            const int bottom = std::min(top + kSharedCells, (py + 1) * s),
                      right = std::min(left + kSharedCells, (px + 1) * s);
            cell.count = 0;
            for (int y = top; y < bottom; ++y) {
                const uint64_t* row = tile.row(y);
                for (int x = left; x < right; ++x, ++cell.count) {
                    cell.key[cell.count] = row[x];
                    cell.number[cell.count] = DepthTile::numberOf(row[x]);
                    cell.x[cell.count] = x, cell.y[cell.count] = y;
                }
            }
            showCell(lookup, cell, take);
        }
    }
}

template <class Take>
void SubpixelShader::showCell(const SampleLookup& lookup, const Cell& cell, const Take& take) {
    uint32_t left = uint32_t((uint64_t(1) << cell.count) - 1);
    while (left) {
        const int first = std::countr_zero(left);
        const uint32_t number = cell.number[first];
        uint32_t members = 0;
        for (int i = first; i < cell.count; ++i) members |= uint32_t(cell.number[i] == number) << i;
        if (number != kNoNumber) {
            if (!context_.lighting->projectors.empty()) members = membersBeside(cell, members);
            if (!showMembers(lookup, cell, members)) {
                members = uint32_t(1) << first;
                show(lookup, cell.key[first], cell.x[first], cell.y[first]);
            }
        }
        left &= ~members;
        for (; members; members &= members - 1) {
            const int i = std::countr_zero(members);
            take(cell.x[i], cell.y[i], cell.key[i]);
        }
    }
}

}  // namespace stipple
