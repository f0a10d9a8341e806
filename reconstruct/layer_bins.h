// SPDX-License-Identifier: Apache-2.0
// The bins of a tile's pixels: layers of blended surface, gathered from points and triangles and
// put together in front of what is opaque. See bins.h.
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/pixel_filter.h>

#include <vector>

namespace stipple {

inline constexpr int kMostBins = 16;  // a pixel

// What a point, or a triangle at a subpixel, adds to a layer.
struct Contribution {
    Vec2 at = Vec2(0);  // subpixels: where the plane has q, 1 / depth (orthographic: depth)
    float q = 0.0f;
    Vec2 slope = Vec2(0);  // of q, by subpixel
    float depth = 0.0f;
    bool faces_eye = true;
    bool is_closed = true;     // on a surface whose holes are to be closed
    bool is_triangle = false;  // a surface has one of them a subpixel
    float alpha = 1.0f;
    Vec3 radiance = Vec3(0);
};

class LayerBins {
public:
    // k: points a subpixel.
    LayerBins(const View& view, double k);

    // How many pixels around one are looked at to close its layers.
    int reach() const { return reach_; }
    // rect: whole pixels, those that have bins.
    void reset(const SubpixelRect& rect);
    // What is opaque; rect: whole pixels, those that count. Call before any of the following.
    void setFronts(const DepthTile& fronts, const SubpixelRect& rect);
    // True if nothing at that depth in the subpixel's pixel can be seen there or in pixels around.
    bool hides(int x, int y, float depth) const {
        return depth > farthest_[pixelIndex(x / subpixels_, y / subpixels_)];
    }
    // For the bins of the pixel of subpixel (x, y), which it covers.
    void add(int x, int y, const Contribution& c);
    // Layers in front of what `shaded` has, for the pixels of `inner`. What has been added goes
    // into the bins front to back, so that its order does not matter.
    void composite(const DepthTile& fronts, const SubpixelRect& inner, ShadedTile& shaded);

private:
    struct Bin {
        float q_low = 0.0f, q_high = 0.0f;  // along the planes to the pixel's middle
        float nearest = kInfinity;          // depth
        float weight = 0.0f;
        float q = 0.0f;  // sums: of q in the middle, slopes, alpha and alpha times radiance
        Vec2 slope = Vec2(0);
        float alpha = 0.0f;
        Vec3 radiance = Vec3(0);
        // Covered cells, row by row: of surfaces that are closed, and of others.
        uint64_t closed = 0, exact = 0;
        uint64_t triangles = 0;  // cells, where a cell is a subpixel: no other is of this layer
        bool faces_eye = true;

        void merge(const Bin& o);
        void putBefore(const Bin& o);
        float middle() const { return q / weight; }
    };
    struct Layer;
    struct Added {
        uint32_t pixel, cell;
        Contribution c;
    };

    size_t pixelIndex(int px, int py) const {
        return size_t(py - y0_) * size_t(width_) + size_t(px - x0_);
    }
    float tolerance(const Bin& bin) const;
    void fillBins();
    void bin(const Added& added);
    void limit(std::vector<Bin>& bins) const;
    void gatherLayers(int px, int py, std::vector<Layer>& layers) const;
    uint64_t closedCells(const Layer& layer, int px, int py) const;

    const int subpixels_;
    const int cells_;   // along a side of a pixel: subpixels, at most eight
    const int radius_;  // of the squares that close a layer, cells
    const int reach_;
    const bool orthographic_;
    const float focal_;
    int x0_ = 0, y0_ = 0, width_ = 0, height_ = 0;  // pixels
    int picture_width_, picture_height_;
    std::vector<Added> added_, sorted_;
    std::vector<uint32_t> pixel_end_;     // in sorted_
    std::vector<std::vector<Bin>> bins_;  // by pixel
    std::vector<float> farthest_;         // by pixel, of what is opaque there and around
};

}  // namespace stipple
