// SPDX-License-Identifier: Apache-2.0
// From where the blocks of a placed model can be seen: visibility cones and visibility masks.
// Based on: Grossman. Point Sample Rendering. 1998, chapter 6 ("Visibility Testing").
#pragma once

#include <sampling/instance_frame.h>
#include <scenegraph/surfel_model.h>

namespace stipple {

// The eye in a model's object space.
struct ModelEye {
    Vec3 eye = Vec3(0);           // perspective
    Vec3 to_eye = Vec3(0, 0, 1);  // orthographic: towards the viewer, any length
    bool orthographic = false;
    bool is_outside = true;  // well outside the model's bounds: masks were found from there

    Vec3 from(const Vec3& p) const { return orthographic ? to_eye : eye - p; }
};

inline ModelEye makeModelEye(const InstanceFrame& frame, const SurfelModel& model,
                             bool orthographic) {
    const DVec3 low(model.bounds.min), high(model.bounds.max), margin = 0.1 * (high - low);
    ModelEye eye;
    eye.eye = Vec3(frame.eye_object);
    eye.to_eye = Vec3(-frame.facing);
    eye.orthographic = orthographic;
    eye.is_outside = orthographic || glm::any(glm::lessThan(frame.eye_object, low - margin)) ||
                     glm::any(glm::greaterThan(frame.eye_object, high + margin));
    return eye;
}

// True if the eye sees nothing but the backs of the block's surfels.
inline bool coneHides(const ModelEye& eye, const SurfelBlock& block) {
    if (!(block.cone_sine < 1.0f)) return false;
    const Vec3 from_apex = eye.from(block.cone_apex);
    return glm::dot(from_apex, block.cone_axis) < -block.cone_sine * glm::length(from_apex);
}

// True if the rest of the model hides the block from the eye.
inline bool maskHides(const ModelEye& eye, const SurfelBlock& block) {
    if (!eye.is_outside) return false;
    const int d = maskDirectionIndex(eye.from(block.bounds.center()));
    return !(block.visible_from[size_t(d / 64)] >> (d % 64) & 1);
}

}  // namespace stipple
