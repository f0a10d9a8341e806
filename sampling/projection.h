// SPDX-License-Identifier: Apache-2.0
// The bound of the projection factor over a node's box: prj(x) = f^2 * (1/z^2) * (cos beta / cos
// alpha) in subpixels per area (orthographic: f^2 * cos beta). Based on: Wand et al. 2001
// ("Projection Factor", "Approximation", "Choosing Groups").
#pragma once

#include <core/camera.h>
#include <core/points.h>

namespace stipple {

// What a box looks like from the eye.
struct BoxProjection {
    bool is_visible = false;  // may touch the frustum
    bool is_inside = false;   // lies wholly within it
    float z_min = 0.0f;       // at least near_z
    SubpixelRect rect;        // clipped to the picture
    float size = 0.0f;  // larger side of the unclipped rectangle, subpixels; infinite if it reaches
                        // behind near_z
    float thickness = 0.0f;    // the smaller side
    double depth_ratio = 1.0;  // z_max / z_min; infinite if it reaches behind near_z
    double bound = 0.0;  // largest projection factor of a unit area with unit area scale, whatever
                         // its orientation
};

// The largest projection of `area` under a bound; infinite near the eye, even where the area is 0.
inline double projectedArea(double area, double bound) {
    return bound < std::numeric_limits<double>::infinity() ? area * bound : bound;
}

// p_camera = linear * p + translation for p in the box.
BoxProjection projectBox(const View& view, const DMat3& linear, const DVec3& translation,
                         const Box3& box);

}  // namespace stipple
