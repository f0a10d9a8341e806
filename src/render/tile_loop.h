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

// Draws all batches of `source` (nullptr: none) into context.picture. Tiles in which nothing
// changes what another tile shows; the same bits for any number of threads. Adds counters and the
// phases "draw" (passes over the points) and "reconstruct" (filling, look-ups, shading, writing) to
// stats, each the mean of the threads' times.
void drawTiles(const ReconstructionContext& context, PointSource* source,
               const std::vector<Batch>& batches, const TriangleLookup& triangle_lookup,
               ThreadPool& pool, const FrameRequest& request, FrameStats& stats);

}  // namespace stipple
