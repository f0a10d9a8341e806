// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/shade.h>

namespace stipple {

namespace {

const float kInvPi = float(1.0 / kPi);

// Irradiance / pi of the sky on a surface: between ground and sky by the normal's height.
Vec3 skyAmbient(const Sky& sky, const Vec3& normal) {
    if (sky.environment) return environmentAmbient(*sky.environment, normal);
    const Vec3 above = 0.5f * (sky.zenith + sky.horizon);
    return glm::mix(sky.ground, above, 0.5f + 0.5f * normal.y);
}

}  // namespace

Vec3 skyRadiance(const Sky& sky, const Vec3& direction) {
    if (sky.environment) return environmentRadiance(*sky.environment, direction);
    if (direction.y < 0.0f) {
        // A soft horizon: ground's colour is reached 10 degrees below it.
        return glm::mix(sky.horizon, sky.ground, std::min(1.0f, -direction.y * 5.7f));
    }
    return glm::mix(sky.horizon, sky.zenith, std::sqrt(direction.y));
}

Vec3 shade(const SurfaceSample& sample, const Material& material, const Lighting& lighting,
           const View& view) {
    if (material.unlit) return sample.albedo;
    const Vec3 to_eye_camera =
        view.orthographic ? Vec3(0.0f, 0.0f, -1.0f) : -sample.position_camera;
    const Vec3 to_eye =
        glm::normalize(Mat3(glm::transpose(view.camera_from_world)) * to_eye_camera);
    Vec3 n = sample.normal_world;
    if (material.double_sided && glm::dot(n, to_eye) < 0.0f) n = -n;

    Vec3 diffuse = skyAmbient(lighting.sky, n) * (1.0f - material.translucency) +
                   skyAmbient(lighting.sky, -n) * material.translucency;
    Vec3 specular(0.0f);
    const bool has_specular =
        material.specular.x + material.specular.y + material.specular.z > 0.0f;
    // irradiance: on a surface that faces the light.
    const auto addLight = [&](const Vec3& direction_to_light, const Vec3& irradiance) {
        const float cosine = glm::dot(n, direction_to_light);
        const float lit = cosine > 0.0f ? cosine * (1.0f - material.translucency)
                                        : -cosine * material.translucency;
        diffuse += irradiance * (lit * kInvPi);
        if (has_specular && cosine > 0.0f) {
            const float r = glm::dot(2.0f * cosine * n - direction_to_light, to_eye);
            if (r > 0.0f) {
                // Normalized Phong lobe, (s + 2) / (2 pi) cos^s.
                const float lobe =
                    (material.shininess + 2.0f) * 0.5f * kInvPi * std::pow(r, material.shininess);
                specular += irradiance * (material.specular * (lobe * cosine));
            }
        }
    };
    for (const Sun& sun : lighting.suns) addLight(sun.direction_to_light, sun.irradiance);
    if (!lighting.points.empty()) {
        const Vec3 from_eye = Mat3(glm::transpose(view.camera_from_world)) * sample.position_camera;
        for (const PointLight& light : lighting.points) {
            // Relative to the eye, so that floats do far from the origin too.
            const Vec3 to_light = Vec3(light.position - view.eye_world) - from_eye;
            const Vec3 irradiance = incidentLight(light, to_light);
            if (irradiance != Vec3(0.0f)) addLight(glm::normalize(to_light), irradiance);
        }
    }
    Vec3 radiance = sample.albedo * diffuse + specular + material.emissive;
    if (lighting.sky.haze_distance > 0.0f) {
        const float distance = glm::length(sample.position_camera);
        radiance = glm::mix(lighting.sky.horizon, radiance,
                            std::exp(-distance / lighting.sky.haze_distance));
    }
    return radiance;
}

}  // namespace stipple
