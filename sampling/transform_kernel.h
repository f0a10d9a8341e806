// SPDX-License-Identifier: Apache-2.0
// The innermost loop of drawing: list points to camera space, and thinning to the exact density.
#pragma once

#include <core/points.h>
#include <sampling/point_list.h>

namespace stipple {

// One node of one instance, as seen from the eye. Positions are taken relative to the eye in object
// space, in double, before they become float.
struct KernelParams {
    Vec3 box_from_eye = Vec3(0);  // the node box's minimum minus the eye, object space
    Vec3 step = Vec3(0);          // object-space size of one quantization step
    Mat3 camera_from_object = Mat3(1.0f);
    bool thin = true;  // else all points are kept, but for those without a patch width
    bool orthographic = false;
    Vec3 facing = Vec3(0);  // orthographic: object-space vector d with prj = f^2 |n.d|
    float gain = 0.0f;      // times |n.d| (/ z^3 in perspective; n is unit * 32767) this is the
                            // probability to keep a point
    float z_near = 0.0f, z_far = kInfinity;  // nearer and farther points are dropped
    bool random = false;                     // thinning numbers: hashed, or a golden-ratio sequence
    uint32_t hash = 0;
    int width_offset = 0;  // takes width codes of metres to those of subpixels
    bool narrow = false;   // widths become kNoPatch
};

// Points [first_index, first_index + count) of a node's sequence, which are the lanes [first_lane,
// first_lane + count) of `list`, become lanes [lane, lane + count) of `out`, numbered from
// first_number. first_lane is a multiple of 16; lanes of `out` up to the next multiple of 16 may be
// overwritten. Same bits on every instruction set.
void transformPoints(const KernelParams& params, const ListBlock& list, int first_lane,
                     uint32_t first_index, int count, uint32_t first_number, int lane,
                     PointBlock& out);

// What surfels need.
struct SurfelParams {
    Mat3 camera_from_normal = Mat3(1.0f);  // takes object-space normals to camera space (not unit)
    float focal = 1.0f;                    // subpixels
    float density = 1.0f;                  // kept points per subpixel of projected area
    bool orthographic = false;
};

// Normals and areas of lanes [lane, lane + count) of `out`, whose positions are there.
void makeSurfels(const SurfelParams& params, const ListBlock& list, int first_lane, int count,
                 int lane, PointBlock& out);

}  // namespace stipple
