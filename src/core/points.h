// SPDX-License-Identifier: Apache-2.0
// What joins sampling and reconstruction: sources plan batches of points and emit them into sinks,
// tile by tile, as often as asked and the same every time (replay). Reconstruction knows points,
// tiles and pixels only. Based on: Levoy, Whitted. The Use of Points as a Display Primitive. 1985
// (points as the meta-primitive).
#pragma once

#include <core/camera.h>
#include <core/disc_cuts.h>
#include <core/parallel.h>
#include <core/settings.h>
#include <core/surface.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <vector>

namespace stipple {

// A rectangle of subpixels, [x0, x1) x [y0, y1).
struct SubpixelRect {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

    int width() const { return x1 - x0; }
    int height() const { return y1 - y0; }
    bool isEmpty() const { return x0 >= x1 || y0 >= y1; }
    bool overlaps(const SubpixelRect& o) const {
        return x0 < o.x1 && o.x0 < x1 && y0 < o.y1 && o.y0 < y1;
    }
};

// Something to draw: a node of the scene graph, which emit() may open further. What the frame loop
// must know to bin, sort and skip it.
struct Batch {
    SubpixelRect rect;          // encloses the projection of all its points, clipped to the picture
    float z_min = 0.0f;         // camera z of its nearest point
    float expected_points = 0;  // about what emit() would draw if nothing hid it
    uint32_t index = 0;         // the source's own number of it
};

inline constexpr int kBlockPoints = 64;

// Numbers of points and of a tile's triangles are below 2^29, those of the z-buffer's below 2^31;
// they carry the kind in their high bits, so that all kinds meet in one depth test.
inline constexpr uint32_t kZBufferBit = 0x80000000u;   // a triangle of the frame's z-buffer
inline constexpr uint32_t kTriangleBit = 0x40000000u;  // a triangle emitted in the tile
// Set by reconstructions in their keys alone: a point, or a triangle of the tile, on a
// wide patch (kSurfaceWidth).
inline constexpr uint32_t kSurfaceBit = 0x20000000u;
inline constexpr uint32_t kAnyTriangle = kZBufferBit | kTriangleBit;

// Kernels work on whole vectors and may write this far beyond a block's last point.
inline constexpr int kBlockPadding = 16;

// Width of the connected patch a point lies on (a leaf, a terrain), logarithmic in 8 bits: code c
// stands for about 2^(first_exponent + c / 8).
inline constexpr int kWidthsPerOctave = 8, kWidthCodes = 256;
constexpr uint8_t patchWidthCode(float width, int first_exponent) {
    // Exponent and the first three bits of the mantissa.
    const int bits =
        int(std::bit_cast<uint32_t>(width) >> 20) - ((127 + first_exponent) * kWidthsPerOctave);
    return uint8_t(std::clamp(bits, 1, kWidthCodes - 1));
}
constexpr float patchWidth(uint8_t code, int first_exponent) {
    return std::bit_cast<float>(uint32_t(int(code) + (127 + first_exponent) * kWidthsPerOctave)
                                << 20);
}
// In subpixels. Code 0, kNoPatch, is kept for points that cover no more than the subpixel they lie
// in, or 1/K of it.
inline constexpr int kFirstSubpixelExponent = -8;
inline constexpr uint8_t kNoPatch = 0;
// On patches at least that wide (subpixels) a hole is to be closed; between narrower ones it is a
// gap.
inline constexpr float kSurfaceWidth = 8.0f;
inline constexpr uint8_t kSurfaceCode = patchWidthCode(kSurfaceWidth, kFirstSubpixelExponent);

// Of points that are kept, see PointBlock::keep.
inline constexpr uint8_t kBlended = 2;
// Blended surfaces are as good as opaque where alpha is at least this, and drawn so.
inline constexpr float kOpaqueAlpha = 254.5f / 255.0f;

// A disc that is no circle, or that lines cut: centre + u axis[0] + v axis[1], inside of an ellipse
// around the centre.
struct DiscShape {
    // Half axes, or what an affine map made of them, in camera space; scaled to span an area of 1.
    std::array<Vec3, 2> axis = {Vec3(1, 0, 0), Vec3(0, 1, 0)};
    int n_cuts = 0;
    std::array<Vec3, kMostDiscCuts> cuts =
        {};  // there is surface where x u + y v <= z, u and v in m

    bool hasSurface(float u, float v) const {
        for (int i = 0; i < n_cuts; ++i) {
            if (cuts[size_t(i)].x * u + cuts[size_t(i)].y * v > cuts[size_t(i)].z) return false;
        }
        return true;
    }
};

// Up to 64 points in camera space, structure of arrays.
struct PointBlock {
    int count = 0;
    alignas(64) float x[kBlockPoints + kBlockPadding];
    alignas(64) float y[kBlockPoints + kBlockPadding];
    alignas(64) float z[kBlockPoints + kBlockPadding];
    alignas(64) uint32_t number[kBlockPoints + kBlockPadding];  // names the point within its tile
    // 1: kept by thinning, 0: not there. For sinks that want layers kBlended: kept, on a blended
    // surface, with an alpha of its own.
    alignas(64) uint8_t keep[kBlockPoints + kBlockPadding];
    alignas(64) uint8_t width[kBlockPoints + kBlockPadding];  // patchWidthCode(), in subpixels
    // Only for sinks that want surfels, and for blended points: geometric normal (unit, camera
    // space, either side) and the area that a kept point stands for, m^2. Not filled where the
    // width is kNoPatch, but for blended points.
    alignas(64) float normal_x[kBlockPoints + kBlockPadding];
    alignas(64) float normal_y[kBlockPoints + kBlockPadding];
    alignas(64) float normal_z[kBlockPoints + kBlockPadding];
    alignas(64) float area[kBlockPoints + kBlockPadding];
    bool is_prebuilt = false;  // areas are those of discs that close the surface, however dense
    // Prebuilt and fewer than the view asks for: for sinks that want surfels they are their discs,
    // however narrow the patch.
    bool is_coarse = false;
    // Prebuilt, each covers no more than the subpixel it lies in (kNoPatch), and all lie on patches
    // that are as wide as kSurfaceWidth: holes between them are closed.
    bool is_on_surface = false;
    // One a point, for sinks that want surfels; nullptr: all are circles.
    const DiscShape* shapes = nullptr;
};

// Says whether a triangle of a block has surface at a subpixel (alpha masks). For sinks that want
// layers blended triangles have none but where they are opaque.
class MaskTest {
public:
    virtual ~MaskTest() = default;
    virtual bool isSurface(int triangle, float sub_x, float sub_y) const = 0;
    // 0..1; of opaque triangles it means nothing.
    virtual float alpha(int triangle, float sub_x, float sub_y) const = 0;
};

// Up to 64 triangles in camera space: too large for points, too small for the z-buffer of the large
// ones; without such a z-buffer, any size, and what is nearer than the view's near_z is cut off.
// Triangle i has the number first_number + i within its tile (with kTriangleBit).
struct TriangleBlock {
    int count = 0;
    uint32_t first_number = 0;
    const MaskTest* mask = nullptr;  // nullptr: all surface
    uint64_t blended = 0;            // for sinks that want layers: bit i, triangle i is blended
    bool is_clear = false;           // for these: all are blended, and none is opaque anywhere
    bool is_wide = false;            // on a patch at least kSurfaceWidth wide
    alignas(64) float x[3][kBlockPoints];  // of the three vertices
    alignas(64) float y[3][kBlockPoints];
    alignas(64) float z[3][kBlockPoints];

    Vec3 vertex(int corner, int i) const { return {x[corner][i], y[corner][i], z[corner][i]}; }
};

// What takes points and triangles: a reconstruction at work on a tile.
class PointSink {
public:
    virtual ~PointSink() = default;
    // False if the sink has no use for any of the block's numbers later.
    virtual bool take(const PointBlock& block) = 0;
    virtual bool take(const TriangleBlock& block) = 0;
    // True if nothing within the rectangle at or behind z_min can change the picture of this tile:
    // sources ask before they open a node. narrow: no point of it will cover more than the subpixel
    // it lies in (kNoPatch).
    virtual bool hides(const SubpixelRect& rect, float z_min, bool narrow) = 0;
    virtual const SubpixelRect& region() const = 0;  // subpixels the sink wants, tile and halo
    // True if blocks must have normals and areas.
    virtual bool wantsSurfels() const { return false; }
    // True if blended surfaces come in all their layers; may be so only where drawsLayers().
    virtual bool wantsLayers() const { return false; }
};

// Emits a source's batches for one tile; used by one thread. Numbers stay valid until forget().
class TileEmitter {
public:
    virtual ~TileEmitter() = default;
    // Pushes what the batch has within the sink's region, near before far, leaving out what the
    // sink hides. The same points every time, but for their numbers.
    virtual void emit(const Batch& batch, PointSink& sink) = 0;
    // Normal, albedo, material and object of an emitted point or triangle, seen at sub_x, sub_y
    // (subpixel coordinates) at sample.depth.
    virtual void attributes(uint32_t number, float sub_x, float sub_y,
                            SurfaceSample& sample) const = 0;
    // Reads ahead what attributes() will need soon.
    virtual void prefetch(uint32_t) const {}
    virtual void forget() = 0;
};

// What has planned points and makes emitters of them, one a thread.
class PointSource {
public:
    virtual ~PointSource() = default;
    virtual std::unique_ptr<TileEmitter> makeEmitter() = 0;
};

}  // namespace stipple
