// SPDX-License-Identifier: Apache-2.0
// The interface of all reconstructions: points and a z-buffer's triangles in, pixels of one tile
// out. A reconstruction works on one tile at a time, in one thread, sees points in a fixed order,
// and may ask to see them several times (passes).
#pragma once

#include <core/ambient_visibility.h>
#include <core/light.h>
#include <core/light_visibility.h>
#include <core/material.h>
#include <core/points.h>
#include <core/raster_job.h>
#include <core/settings.h>
#include <reconstruct/picture.h>

#include <memory>

namespace stipple {

// Looks up what a number stands for. sub_x, sub_y: where it is seen, subpixel coordinates. Fills
// all but depth and position.
class SampleLookup {
public:
    virtual ~SampleLookup() = default;
    virtual void lookUp(uint32_t number, float sub_x, float sub_y, SurfaceSample& sample) const = 0;
    // Reads ahead what lookUp() will need soon.
    virtual void prefetch(uint32_t) const {}
};

// What all tiles of a frame share.
struct ReconstructionContext {
    View view;
    RenderSettings settings;
    const std::vector<Material>* materials = nullptr;
    const Lighting* lighting = nullptr;
    const RasterTarget* base = nullptr;                     // rasterized triangles; nullptr: none
    const LightVisibility* light_visibility = nullptr;      // nullptr: nothing casts shadows
    const AmbientVisibility* ambient_visibility = nullptr;  // nullptr: all is open
    Picture* picture = nullptr;
};

struct TileCounters {
    uint64_t points_drawn = 0;
    uint64_t points_kept = 0;  // kept and within the tile proper
    uint64_t triangles = 0;    // rasterized in tiles
};

class TileReconstruction : public PointSink {
public:
    // Passes over the points.
    virtual int passCount() const = 0;
    // Subpixels around a tile whose points it must see.
    virtual int halo() const = 0;
    // inner: the tile; outer: with the halo, clipped to the picture.
    virtual void beginTile(const SubpixelRect& inner, const SubpixelRect& outer) = 0;
    virtual void beginPass(int pass, const SampleLookup& lookup) = 0;
    // Fills holes, looks up, shades and writes the pixels of the tile.
    virtual void endTile(const SampleLookup& lookup) = 0;
    virtual TileCounters counters() const = 0;
};

// The settings with which a frame is drawn for settings.reconstruct. Reconstructions that use all
// points, not only the nearest of a subpixel, draw more and smaller subpixels with as many points
// as long as at least about one point falls into each: at 1 x 1 subpixels of 4 points, 2 x 2 of
// one. Never above 4 x 4, where edges have gradations enough.
RenderSettings drawnSettings(const RenderSettings& settings);

// One instance a thread.
std::unique_ptr<TileReconstruction> makeReconstruction(const ReconstructionContext& context);

}  // namespace stipple
