// SPDX-License-Identifier: Apache-2.0
// The middle of every frame: tiles in parallel, passes, batches front to back.
#pragma once

#include <core/points.h>
#include <reconstruct/reconstruction.h>
#include <render/renderer.h>

#include <functional>

namespace stipple {

// Attributes of rasterized triangles, by number (without kZBufferBit).
using TriangleLookup =
    std::function<void(uint32_t number, float sub_x, float sub_y, SurfaceSample& sample)>;

// One view to be drawn tile by tile.
struct TileJob {
    View view;
    int tile_size = 384;                                                      // side, subpixels
    std::function<std::unique_ptr<TileReconstruction>()> makeReconstruction;  // one a thread
    std::function<bool(const SubpixelRect& inner)> is_wanted;  // empty: all tiles are
    PointSource* source = nullptr;                             // nullptr: none
    const std::vector<Batch>* batches = nullptr;
    const TriangleLookup* triangle_lookup = nullptr;
    const char* phase = "draw";  // for progress
};

// A side for a view's tiles, subpixels: at most `largest`, and smaller where the picture would be
// too few tiles to share among threads. Of the view alone, so that pictures are the same for any
// number of them.
int tileSide(const View& view, int largest);

// Seconds of all threads together.
struct TileTimes {
    double draw = 0.0, finish = 0.0;
};

// Draws a job's tiles in parallel, each by one thread, its batches front to back; the same bits for
// any number of threads. Adds what was drawn to stats, but no phases.
TileTimes runTiles(const TileJob& job, ThreadPool& pool, const FrameRequest& request,
                   FrameStats& stats);

// Draws all batches of `source` (nullptr: none) into context.picture. Tiles in which nothing
// changes what another tile shows; the same bits for any number of threads. Adds counters and the
// phases "draw" (passes over the points) and "reconstruct" (filling, look-ups, shading, writing) to
// stats, each the mean of the threads' times.
void drawTiles(const ReconstructionContext& context, PointSource* source,
               const std::vector<Batch>& batches, const TriangleLookup& triangle_lookup,
               ThreadPool& pool, const FrameRequest& request, FrameStats& stats);

}  // namespace stipple
