// SPDX-License-Identifier: Apache-2.0
// Lights and the background, in world space. Radiometric scale: a white diffuse surface facing a
// sun of irradiance 1 has radiance 1 / pi; pictures are multiplied by 2^exposure.
#pragma once

#include <core/math.h>
#include <core/projector.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

namespace stipple {

// Parallel light.
struct Sun {
    Vec3 direction_to_light = Vec3(0.4f, 0.8f, 0.45f);  // world, normalized when loaded
    Vec3 irradiance = Vec3(3.0f, 2.85f, 2.6f);          // on a surface facing it
};

// Shines from a point into all directions, or into a cone: a spot light. Falloff and cone are those
// of glTF's KHR_lights_punctual.
struct PointLight {
    DVec3 position = DVec3(0.0);
    Vec3 intensity = Vec3(1.0f);  // irradiance on a surface that faces it 1 m away
    float range = 0.0f;           // metres after which nothing is lit; 0: none
    bool is_spot = false;
    Vec3 axis = Vec3(0, -1, 0);     // spot: where it shines, unit
    float inner_cone = 0.0f;        // spot: angle from the axis, radians: full light up to here ...
    float outer_cone = 0.7853982f;  // ... and none from here; inner_cone < outer_cone <= pi / 2
};

// What is nearer to a point or spot light than this is part of it and casts no shadow: metres.
inline constexpr float kLampClearance = 0.01f;

// Irradiance on a surface at `to_light` from the light that faces it (to_light: metres from there
// to the light's position, not 0).
Vec3 incidentLight(const PointLight& light, const Vec3& to_light);

// A picture of all that is around, infinitely far away: equirectangular, row 0 is up (+y), the
// middle column looks along -z and columns go on towards +x.
struct Environment {
    int width = 0;
    int height = 0;
    std::vector<Vec3> radiance;  // width * height
    float turn = 0.0f;           // of the picture about +y, counter-clockwise from above, radians
    // Order-2 spherical harmonics of irradiance / pi, by prepareEnvironment(), before the turn.
    std::array<Vec3, 9> irradiance_over_pi{};
    Vec3 horizon = Vec3(0.0f);  // mean radiance within 5 degrees of the horizon

    size_t bytes() const { return radiance.capacity() * sizeof(Vec3); }
};

// Halves the picture until it is at most `most_columns` wide and fills what follows from it. Based
// on: Ramamoorthi, Hanrahan. An Efficient Representation for Irradiance Environment Maps. 2001.
void prepareEnvironment(Environment& environment, int most_columns = 4096);
// In a unit direction, interpolated between texels.
Vec3 environmentRadiance(const Environment& environment, const Vec3& direction_world);
// Irradiance / pi on a surface of that unit normal. A smooth estimate, a few per cent off; at least
// 0.
Vec3 environmentAmbient(const Environment& environment, const Vec3& normal_world);

// What is seen where nothing is, and the light that comes from there: radiance goes from `horizon`
// to `zenith` above, and to `ground` below the horizon. Surfaces receive its irradiance by their
// normal (hemisphere light).
struct Sky {
    Vec3 zenith = Vec3(0.22f, 0.40f, 0.75f);
    Vec3 horizon = Vec3(0.70f, 0.80f, 0.92f);
    Vec3 ground = Vec3(0.25f, 0.23f, 0.20f);
    float haze_distance =
        0.0f;  // metres after which 1 - 1/e of the horizon's colour covers a surface; 0: none
    // Takes the place of the three colours, but for the haze; may be null.
    std::shared_ptr<const Environment> environment;
};

struct Lighting {
    std::vector<Sun> suns;
    std::vector<PointLight> points;
    std::vector<Projector> projectors;
    Sky sky;
    float exposure = 0.0f;  // stops
};

// What casts shadows from a place: the point lights, then a spot light around each projector's
// beam.
std::vector<PointLight> lampsOf(const Lighting& lighting);

}  // namespace stipple
