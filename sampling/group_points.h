// SPDX-License-Identifier: Apache-2.0
// Points on everything below a node of a group, where all of it is far enough to be drawn at one
// density: spread along the cumulated areas of its instances, down to their meshes. Based on: Wand
// et al. 2001 ("Dynamic Distribution Lists").
#pragma once

#include <sampling/mesh_points.h>

namespace stipple {

class GroupPoints {
public:
    GroupPoints(TileContext& context, PointWriter& points) : context_(context), points_(points) {}

    // density.drawn is per m^2 of the group's own space. O(a log n) with the random sampler, by
    // systematic sampling with the stratified one: O(nodes that receive a point).
    void draw(ChildRef group, uint32_t node, const Affine& camera_from_group, uint64_t path,
              const RunDensity& density);

private:
    void sweep(ChildRef group, uint32_t node, const Affine& camera_from_group, uint64_t path,
               double base, double scale);
    void sweepChild(ChildRef group, const Affine& camera_from_group, uint64_t path, double base,
                    double scale, uint64_t count);
    uint64_t changedCount(const Group& group, double count, uint64_t path) const;
    void drawOne(ChildRef group, uint32_t node, const Affine& camera_from_group, uint64_t path,
                 double scale, double position, uint32_t index);
    void drawList(const Affine& camera_from_child, ChildRef child, uint32_t node, uint64_t path,
                  double scale, uint32_t count);
    uint64_t pointsBefore(double position) const;
    // Where `scale` carries areas of a child to the node that is drawn.
    RunDensity childDensity(double scale) const;

    TileContext& context_;
    PointWriter& points_;
    // Of the node that is drawn.
    RunDensity density_;
    double spacing_ = 1.0, phase_ = 0.0;
};

}  // namespace stipple
