// SPDX-License-Identifier: Apache-2.0
// Pull-push reconstruction: hierarchical depth buffers find the gaps of surfaces, averages over
// coarser and coarser pixels fill them.
// Based on: Grossman. Point Sample Rendering. MIT MSc thesis, 1998, chapter 4 and section 9.1.2.
//
// As in the thesis: a point goes into the depth buffer of the level at which its surface has no
// gaps; a subpixel that lies behind (by three of that level's pixels) is covered to the degree that
// the bilinear mesh through the buffer's cells says; its weight is one minus the sum over the
// levels; points that show their back weigh nothing; pull and push with 1/2, 1/4, 1/4.
// Otherwise:
// - The level follows from the density of kept points, which is the same on every surface, and
//   from the patch a point lies on: foliage has no level above 0, its gaps are true ones.
// - The thesis tests a point against its level when it is drawn, so the picture depends on the
//   points' order. Here all buffers are filled, by minima, before a subpixel is judged at the
//   tile's end: the same, in one pass over the points.
// - A cell at a silhouette counts by how much of it the surface fills, and the mesh fades over two
//   subpixels, not over a cell: foreground colours end where the surface does.
// - What a surface does not cover is filled from what lies behind it (pull_push_fill.h).
// - Holes where two levels meet, open in the thesis: neither level's mesh covers what lies between
//   the last cells' centres of both. Finer points therefore enter the coarser buffers, too, and
//   count in cells next to one that has points of that level, as do triangles: the coarse mesh goes
//   on for a cell below the finer one (level_depths.h).
// - Pyramids live in a tile with its halo, which is as wide as the levels reach, and lie on
//   multiples of their cells: the picture is the same for any size of tiles.
#pragma once

#include <reconstruct/reconstruction.h>

namespace stipple {

// One pass. Settings: pull_push_coverage, pull_push_threshold.
std::unique_ptr<TileReconstruction> makePullPush(const ReconstructionContext& context);

}  // namespace stipple
