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
        nullptr;  // from that direction; nullptr: the whole surface is drawn
    // Of the points on the whole surface: as many are drawn of the whole mesh, beside those on the
    // visible area, and of its parts, which are many and would each need lists of their own.
    double whole_share = 1.0, part_share = 1.0;
    double layers = 1.0;  // of surface behind each other
};

// drawn: points per m^2 of object space on the whole surface, were all of it drawn. The instance
// must be far enough to be seen from one direction.
SeenMesh seeMesh(TileContext& context, const InstanceFrame& frame, uint32_t mesh, double drawn);

// Draws a node of the mesh. count: points on the whole surface below it, were all of it drawn.
void addMeshPoints(TileContext& context, PointWriter& points, const InstanceFrame& frame,
                   uint32_t mesh, uint32_t node, const SeenMesh& seen, RunDensity density,
                   double count);

}  // namespace stipple
