// SPDX-License-Identifier: Apache-2.0
// Lights and the background, in world space. Radiometric scale: a white diffuse surface facing a
// sun of irradiance 1 has radiance 1 / pi; pictures are multiplied by 2^exposure.
#pragma once

#include <core/math.h>

#include <string>
#include <vector>

namespace stipple {

// Parallel light.
struct Sun {
    Vec3 direction_to_light = Vec3(0.4f, 0.8f, 0.45f);  // world, normalized when loaded
    Vec3 irradiance = Vec3(3.0f, 2.85f, 2.6f);          // on a surface facing it
};

// What is seen where nothing is, and the light that comes from there: radiance goes from `horizon`
// to `zenith` above, and to `ground` below the horizon. Surfaces receive its irradiance by their
// normal (hemisphere light).
struct Sky {
    Vec3 zenith = Vec3(0.22f, 0.40f, 0.75f);
    Vec3 horizon = Vec3(0.70f, 0.80f, 0.92f);
    Vec3 ground = Vec3(0.25f, 0.23f, 0.20f);
    float haze_distance =
        0.0f;  // metres after which 1 - 1/e of the horizon's colour covers a surface; 0: none
};

struct Lighting {
    std::vector<Sun> suns;
    Sky sky;
    float exposure = 0.0f;  // stops
};

}  // namespace stipple
