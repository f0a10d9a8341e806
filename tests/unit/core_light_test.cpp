// SPDX-License-Identifier: Apache-2.0
// Point and spot lights by KHR_lights_punctual, and environments against brute force.
#include <core/light.h>
#include <core/rng.h>
#include <gtest/gtest.h>
#include <reconstruct/shade.h>

namespace stipple {
namespace {

TEST(CoreLight, pointLightsFallOffWithTheSquaredDistance) {
    PointLight light;
    light.intensity = Vec3(8.0f, 4.0f, 0.0f);
    EXPECT_EQ(incidentLight(light, Vec3(0, 2, 0)), Vec3(2.0f, 1.0f, 0.0f));
    light.range = 4.0f;
    EXPECT_NEAR(incidentLight(light, Vec3(0, 2, 0)).x, 2.0f * (1.0f - 1.0f / 16.0f), 1e-6f);
    EXPECT_EQ(incidentLight(light, Vec3(5, 0, 0)), Vec3(0.0f));
    EXPECT_EQ(incidentLight(light, Vec3(0)), Vec3(0.0f));
}

TEST(CoreLight, spotLightsShineIntoTheirCone) {
    PointLight light;
    light.is_spot = true;
    light.axis = Vec3(0, -1, 0);
    light.inner_cone = 0.2f, light.outer_cone = 0.6f;
    const auto at = [&](float angle) {  // from a place that far off the axis, at distance 1
        return incidentLight(light, Vec3(std::sin(angle), std::cos(angle), 0)).x;
    };
    EXPECT_NEAR(at(0.1f), 1.0f, 1e-5f);
    EXPECT_EQ(at(0.61f), 0.0f);
    EXPECT_EQ(at(3.0f), 0.0f);
    const float t = (std::cos(0.4f) - std::cos(0.6f)) / (std::cos(0.2f) - std::cos(0.6f));
    EXPECT_NEAR(at(0.4f), t * t, 1e-5f);
}

// A white diffuse surface facing up, seen from above.
Vec3 shadedFloor(const Lighting& lighting, const DVec3& eye, const DVec3& place) {
    Camera camera = lookAt(eye, place);
    const View view = makeView(camera, 8, 8, 1);
    SurfaceSample sample;
    sample.position_camera = Vec3(view.camera_from_world * (place - eye));
    sample.depth = sample.position_camera.z;
    sample.albedo = Vec3(1.0f);
    Material material;
    return shade(sample, material, lighting, view);
}

TEST(CoreLight, pointLightsShadeSurfacesWhereverTheSceneIs) {
    for (const DVec3& origin : {DVec3(0.0), DVec3(3e6, 0.0, -7e6)}) {
        Lighting lighting;
        lighting.sky.zenith = lighting.sky.horizon = lighting.sky.ground = Vec3(0.0f);
        PointLight light;
        light.position = origin + DVec3(0, 2, 0);
        light.intensity = Vec3(4.0f);
        lighting.points.push_back(light);
        const Vec3 below = shadedFloor(lighting, origin + DVec3(1, 5, 0), origin);
        EXPECT_NEAR(below.x, 1.0 / kPi, 1e-3);
        // 2 m aside: a distance of sqrt(8), at 45 degrees.
        const Vec3 aside = shadedFloor(lighting, origin + DVec3(1, 5, 0), origin + DVec3(2, 0, 0));
        EXPECT_NEAR(aside.x, 0.5 * std::sqrt(0.5) / kPi, 1e-3);
    }
}

Environment environment(int width, int height, Vec3 (*radiance)(const Vec3&)) {
    Environment e;
    e.width = width, e.height = height;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const double el = kPi * (0.5 - (y + 0.5) / height),
                         az = 2.0 * kPi * ((x + 0.5) / width - 0.5);
            e.radiance.push_back(radiance(Vec3(
                DVec3(std::sin(az) * std::cos(el), std::sin(el), -std::cos(az) * std::cos(el)))));
        }
    }
    prepareEnvironment(e);
    return e;
}

TEST(CoreLight, environmentsShowTheDirectionAskedForAndTurn) {
    Environment e = environment(256, 128, [](const Vec3& d) { return d + Vec3(2.0f); });
    const Vec3 directions[] = {Vec3(0, 1, 0), Vec3(0, 0, -1), Vec3(1, 0, 0), Vec3(-0.6f, 0, 0.8f),
                               Vec3(0, -0.6f, 0.8f)};
    for (const Vec3& d : directions)
        EXPECT_LT(glm::length(environmentRadiance(e, d) - (d + Vec3(2.0f))), 0.03f);
    // What was seen along -z is seen along -x after a quarter turn, counter-clockwise from above.
    e.turn = float(0.5 * kPi);
    EXPECT_LT(glm::length(environmentRadiance(e, Vec3(-1, 0, 0)) - Vec3(2, 2, 1)), 0.03f);
    EXPECT_LT(glm::length(environmentAmbient(e, Vec3(-1, 0, 0)) - Vec3(2, 2, 2.0f - 2.0f / 3)),
              0.01f);
}

TEST(CoreLight, environmentsLightSurfacesAsTheIntegralSays) {
    // A bright, large lamp above on one side, and ground.
    const auto radiance = [](const Vec3& d) {
        return d.y < 0.0f
                   ? Vec3(0.2f, 0.1f, 0.1f)
                   : Vec3(0.4f) + Vec3(1.0f) * std::max(0.0f, glm::dot(d, Vec3(0.8f, 0.6f, 0)));
    };
    const Environment e = environment(128, 64, radiance);
    for (const Vec3& n :
         {Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 0.6f, 0.8f)}) {
        DVec3 sum(0.0);
        constexpr int kDirections = 200000;
        Rng rng{7};
        for (int i = 0; i < kDirections; ++i) {
            const double y = rng.uniform(-1.0, 1.0), az = rng.uniform(0.0, 2.0 * kPi),
                         s = std::sqrt(1.0 - y * y);
            const Vec3 d(DVec3(s * std::cos(az), y, s * std::sin(az)));
            sum += DVec3(radiance(d)) * (4.0 * std::max(0.0, double(glm::dot(d, n))) / kDirections);
        }
        const Vec3 estimate = environmentAmbient(e, n);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(estimate[c], sum[c], 0.03) << n.x << n.y << n.z;
    }
}

TEST(CoreLight, environmentsOfOneValueAreThatValueEverywhere) {
    for (const auto& [w, h] : {std::pair(1, 1), std::pair(5, 3), std::pair(64, 32)}) {
        Environment e = environment(w, h, [](const Vec3&) { return Vec3(0.5f, 1.0f, 2.0f); });
        EXPECT_LT(glm::length(environmentRadiance(e, Vec3(0.6f, 0.8f, 0)) - Vec3(0.5f, 1, 2)),
                  1e-5f);
        EXPECT_LT(glm::length(e.horizon - Vec3(0.5f, 1, 2)), 1e-4f);
        if (w > 1) {
            EXPECT_LT(glm::length(environmentAmbient(e, Vec3(0, 0, 1)) - Vec3(0.5f, 1, 2)), 0.2f);
        }
    }
    Environment wide = environment(64, 2, [](const Vec3&) { return Vec3(1.0f); });
    prepareEnvironment(wide, 16);
    EXPECT_EQ(wide.width, 16);
    EXPECT_EQ(wide.radiance.size(), size_t(wide.width) * size_t(wide.height));
}

}  // namespace
}  // namespace stipple
