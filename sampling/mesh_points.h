// SPDX-License-Identifier: Apache-2.0
// Points on a mesh's instance: on its whole surface, on what can be seen of it from the eye's
// direction, or on both, as much of each as makes it cover what it should (visible_area.h).
#pragma once

#include <sampling/point_writer.h>

namespace stipple {

// What is drawn of an instance.
struct SeenMesh {
    int direction = ListName::kWhole;
    const VisibleArea* visible =
        nullptr;               // from that direction; nullptr: the whole surface is drawn
    double whole_share = 1.0;  // of the points that lie on the whole surface
    double layers = 1.0;       // its area over the visible one
};

// drawn: points per m^2 of object space on the whole surface, were all of it drawn. The instance
// must be far enough to be seen from one direction.
SeenMesh seeMesh(TileContext& context, const InstanceFrame& frame, uint32_t mesh, double drawn);

// Draws a node of the mesh. count: points on the whole surface below it, were all of it drawn.
void addMeshPoints(TileContext& context, PointWriter& points, const InstanceFrame& frame,
                   uint32_t mesh, uint32_t node, const SeenMesh& seen, RunDensity density,
                   double count);

}  // namespace stipple
