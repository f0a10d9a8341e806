// SPDX-License-Identifier: Apache-2.0
// Points on a mesh's instance: on what can be seen of it from the eye's direction, or on its whole
// surface, as many as make it cover what it should (visible_area.h).
#pragma once

#include <sampling/point_writer.h>

namespace stipple {

// What is drawn of an instance.
struct SeenMesh {
    int direction = ListName::kWhole;  // kWhole: the whole surface is drawn
    // Of the points on the whole surface: as many are drawn on what is seen from the direction, or,
    // of the whole surface, where only parts of the mesh are drawn.
    double visible_share = 1.0, whole_share = 1.0;
    double layers = 1.0;  // of surface behind each other

    bool hasVisible() const { return direction != ListName::kWhole; }
};

// Whether meshes and groups are drawn by what can be seen of them, not by all of their surface.
bool drawsWhatIsSeen(const RenderSettings& settings);

// density: of the whole surface, were all of it drawn. The instance must be far enough to be seen
// from one direction.
SeenMesh seeMesh(TileContext& context, const InstanceFrame& frame, uint32_t mesh,
                 const RunDensity& density);

// Draws a node of the mesh: where it is all of it and hasVisible(), what is seen. count: points on
// the whole surface below it, were all of it drawn.
void addMeshPoints(TileContext& context, PointWriter& points, const InstanceFrame& frame,
                   uint32_t mesh, uint32_t node, const SeenMesh& seen, RunDensity density,
                   double count);

}  // namespace stipple
