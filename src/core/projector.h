// SPDX-License-Identifier: Apache-2.0
// Pictures thrown onto whatever lies before a projector (projective texturing): in place of the
// surfaces' colours, or as what these are seen through. Based on: Segal et al. Fast Shadows and
// Lighting Effects Using Texture Mapping. 1992.
#pragma once

#include <core/camera.h>
#include <core/material.h>

#include <memory>

namespace stipple {

enum class ProjectorMode : uint8_t { kReplace, kModulate };

struct Projector {
    std::string name;
    View view;                               // perspective; a pixel is a texel of the picture
    std::shared_ptr<const Texture> picture;  // its alpha says how much of it is thrown
    ProjectorMode mode = ProjectorMode::kReplace;
};

// The base colour of a surface that the picture falls on: `color` where it does not, and on sides
// that face away. place: world; normal_world: unit; width: metres of the surface that the colour
// stands for, over which the picture is averaged; lit: share of the picture that arrives, see
// shadows.
Vec3 projectedColor(const Projector& projector, const Vec3& color, const DVec3& place,
                    const Vec3& normal_world, float width, float lit);
// False outside of the beam and on sides that face away: nothing arrives.
bool isInBeam(const Projector& projector, const DVec3& place, const Vec3& normal_world);

}  // namespace stipple
