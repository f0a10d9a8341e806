// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/shade.h>

#include <algorithm>
#include <array>
#include <optional>

namespace stipple {

namespace {

const float kInvPi = float(1.0 / kPi);

// Irradiance / pi of the sky on a surface: between ground and sky by the normal's height.
Vec3 skyAmbient(const Sky& sky, const Vec3& normal) {
    if (sky.environment) return environmentAmbient(*sky.environment, normal);
    const Vec3 above = 0.5f * (sky.zenith + sky.horizon);
    return glm::mix(sky.ground, above, 0.5f + 0.5f * normal.y);
}

// What is mirrored at normal incidence, and where it ends at grazing incidence.
struct Fresnel {
    Vec3 normal = Vec3(0);
    float grazing = 1.0f;

    Fresnel(const Vec3& albedo, const SurfaceFinish& f)
        : normal(glm::mix(f.specular, albedo, f.metallic)),
          grazing(glm::mix(f.specular_edge, 1.0f, f.metallic)) {}
    bool isNone() const { return normal == Vec3(0.0f); }
    // Schlick's approximation.
    Vec3 at(float cosine) const {
        const float away = std::clamp(1.0f - cosine, 0.0f, 1.0f), away2 = away * away;
        return normal + (Vec3(grazing) - normal) * (away2 * away2 * away);
    }
};

// A perfect mirror shows no highlight of a light without extent: never quite one.
float microfacetWidth(float roughness) { return std::max(roughness * roughness, 1e-3f); }

// Smith's masking for one direction over twice its cosine, for GGX of width a.
float maskingOverCosine(float cosine, float a2) {
    return 1.0f / (cosine + std::sqrt(a2 + (1.0f - a2) * cosine * cosine));
}

float largest(const Vec3& v) { return std::max({v.x, v.y, v.z}); }

// Share of even surroundings that the lobe mirrors, as (x, y): x times the reflectance at normal
// incidence plus y times that at grazing incidence. Based on: Karis. Real Shading in Unreal Engine
// 4. 2013 ("Environment BRDF").
class MirroredShares {
public:
    MirroredShares() {
        for (int j = 0; j < kSize; ++j) {
            for (int i = 0; i < kSize; ++i)
                table_[j * kSize + i] = integrate(cosineOf(i), float(j) / float(kSize - 1));
        }
    }
    Vec2 at(float n_v, float roughness) const {
        const float x = std::sqrt(std::clamp(n_v, 0.0f, 1.0f)) * float(kSize - 1),
                    y = std::clamp(roughness, 0.0f, 1.0f) * float(kSize - 1);
        const int x0 = std::min(int(x), kSize - 2), y0 = std::min(int(y), kSize - 2);
        const Vec2* t = table_.data() + y0 * kSize + x0;
        const float fx = x - float(x0), fy = y - float(y0);
        return glm::mix(glm::mix(t[0], t[1], fx), glm::mix(t[kSize], t[kSize + 1], fx), fy);
    }

private:
    static constexpr int kSize = 16;
    // Closer together where the edge is near.
    static float cosineOf(int i) {
        const float root = std::max(float(i) / float(kSize - 1), 0.02f);
        return root * root;
    }
    // Over half vectors, as dense as the lobe has them; its two halves are alike.
    static Vec2 integrate(float n_v, float roughness) {
        constexpr int kRings = 24, kSectors = 16;
        const float a = microfacetWidth(roughness), a2 = a * a;
        const Vec2 eye(std::sqrt(1.0f - n_v * n_v), n_v);  // x, z; the normal is z
        Vec2 sum(0.0f);
        for (int i = 0; i < kRings; ++i) {
            const float u = (float(i) + 0.5f) / kRings;
            const float n_h = std::sqrt((1.0f - u) / (1.0f + (a2 - 1.0f) * u));
            for (int j = 0; j < kSectors; ++j) {
                const float azimuth = float(kPi) * (float(j) + 0.5f) / kSectors;
                const float h_x = std::sqrt(1.0f - n_h * n_h) * std::cos(azimuth);
                const float v_h = eye.x * h_x + eye.y * n_h;
                const float n_l = 2.0f * v_h * n_h - n_v;
                if (v_h <= 0.0f || n_l <= 0.0f) continue;
                const float weight = maskingOverCosine(n_l, a2) * maskingOverCosine(n_v, a2) * n_l *
                                     4.0f * v_h / n_h;
                const float edge = std::pow(std::max(1.0f - v_h, 0.0f), 5.0f);
                sum += Vec2(1.0f - edge, edge) * weight;
            }
        }
        return sum / float(kRings * kSectors);
    }

    std::array<Vec2, size_t(kSize) * kSize> table_;
};

Vec3 mirroredOfSurroundings(const Fresnel& fresnel, float roughness, float n_v) {
    static const MirroredShares shares;
    const Vec2 share = shares.at(n_v, roughness);
    return fresnel.normal * share.x + Vec3(fresnel.grazing * share.y);
}

}  // namespace

Brdf evaluateBrdf(const Vec3& albedo, const SurfaceFinish& finish, const Vec3& normal,
                  const Vec3& to_light, const Vec3& to_eye) {
    Brdf brdf;
    const float n_l = glm::dot(normal, to_light), n_v = glm::dot(normal, to_eye);
    if (!(n_l > 0.0f) || !(n_v > 0.0f)) return brdf;
    const Vec3 diffuse = albedo * ((1.0f - finish.metallic) * kInvPi);
    const Fresnel fresnel(albedo, finish);
    if (fresnel.isNone()) {
        brdf.diffuse = diffuse;
        return brdf;
    }
    const Vec3 half = glm::normalize(to_light + to_eye);
    const Vec3 mirrored = fresnel.at(glm::dot(half, to_eye));
    const float a = microfacetWidth(finish.roughness), a2 = a * a;
    // 1 - (n.h)^2 (1 - a^2), by the sine: no cancellation where a highlight is small.
    const Vec3 across = glm::cross(normal, half);
    const float n_h = glm::dot(normal, half);
    const float spread = glm::dot(across, across) + n_h * n_h * a2;
    const float distribution = a2 * kInvPi / (spread * spread);
    brdf.specular =
        mirrored * (distribution * maskingOverCosine(n_l, a2) * maskingOverCosine(n_v, a2));
    brdf.diffuse = diffuse * (1.0f - largest(mirrored));
    return brdf;
}

Vec3 skyRadiance(const Sky& sky, const Vec3& direction) {
    if (sky.environment) return environmentRadiance(*sky.environment, direction);
    return glm::mix(sky.horizon, direction.y < 0.0f ? sky.ground : sky.zenith,
                    skyShare(direction.y));
}

namespace {

// The sample under the pictures that projectors throw on it, one after the other.
SurfaceSample underProjectors(SurfaceSample sample, const Material& material,
                              const Lighting& lighting, const View& view,
                              const LightVisibility* lights) {
    const DMat3 world_from_camera = glm::transpose(view.camera_from_world);
    const DVec3 place = view.eye_world + world_from_camera * DVec3(sample.position_camera);
    const Vec3 to_eye =
        view.orthographic ? -Vec3(world_from_camera[2]) : Vec3(view.eye_world - place);
    Vec3 n = sample.normal_world;
    if (material.double_sided && glm::dot(n, to_eye) < 0.0f) n = -n;
    const float width =
        sample.extent * (view.orthographic ? 1.0f : sample.depth) / float(view.focal);
    for (size_t i = 0; i < lighting.projectors.size(); ++i) {
        const Projector& projector = lighting.projectors[i];
        if (!isInBeam(projector, place, n)) continue;
        const float lit = lights ? lights->ofLamp(lighting.points.size() + i, sample) : 1.0f;
        sample.albedo = projectedColor(projector, sample.albedo, place, n, width, lit);
    }
    return sample;
}

}  // namespace

Vec3 shade(const SurfaceSample& found, const Material& material, const Lighting& lighting,
           const View& view, const LightVisibility* lights, const AmbientVisibility* ambient) {
    std::optional<SurfaceSample> projected;
    if (!lighting.projectors.empty())
        projected = underProjectors(found, material, lighting, view, lights);
    const SurfaceSample& sample = projected ? *projected : found;
    if (material.unlit) return sample.albedo;
    const Vec3 to_eye_camera =
        view.orthographic ? Vec3(0.0f, 0.0f, -1.0f) : -sample.position_camera;
    const Vec3 to_eye = glm::normalize(view.world_from_camera * to_eye_camera);
    Vec3 n = sample.normal_world;
    if (material.double_sided && glm::dot(n, to_eye) < 0.0f) n = -n;

    const SurfaceFinish& finish = sample.finish;
    const float open = ambient ? ambient->of(sample, n) : 1.0f;
    const Vec3 sky = skyAmbient(lighting.sky, n) * open;
    const Vec3 through = sample.albedo * ((1.0f - finish.metallic) * material.translucency);
    const Vec3 scattered =
        sample.albedo * ((1.0f - finish.metallic) * (1.0f - material.translucency));
    Vec3 radiance = finish.emissive;
    if (through != Vec3(0.0f)) {
        const float open_behind = ambient ? ambient->of(sample, -n) : 1.0f;
        radiance += skyAmbient(lighting.sky, -n) * through * open_behind;
    }
    const Fresnel fresnel(sample.albedo, finish);
    if (fresnel.isNone()) {
        radiance += sky * scattered;
    } else {
        // A surface seen from behind (its normal is a shading normal) mirrors as at its edge.
        const float n_v = std::max(glm::dot(n, to_eye), 1e-3f);
        const Vec3 share = mirroredOfSurroundings(fresnel, finish.roughness, n_v);
        const Vec3 direction = glm::normalize(2.0f * n_v * n - to_eye);
        const Vec3 mirrored = glm::mix(skyRadiance(lighting.sky, direction),
                                       skyAmbient(lighting.sky, direction), finish.roughness);
        radiance += mirrored * share * open + sky * scattered * (1.0f - largest(share));
    }
    // irradiance: on a surface that faces the light.
    const auto addLight = [&](const Vec3& direction_to_light, const Vec3& irradiance) {
        const float cosine = glm::dot(n, direction_to_light);
        if (cosine <= 0.0f) {
            radiance += irradiance * through * (-cosine * kInvPi);
            return;
        }
        Vec3 reflected = scattered * kInvPi;
        if (!fresnel.isNone() && glm::dot(n, to_eye) > 0.0f) {
            const Brdf brdf = evaluateBrdf(sample.albedo, finish, n, direction_to_light, to_eye);
            reflected = brdf.diffuse * (1.0f - material.translucency) + brdf.specular;
        }
        radiance += irradiance * reflected * cosine;
    };
    for (size_t i = 0; i < lighting.suns.size(); ++i) {
        const Sun& sun = lighting.suns[i];
        if (through == Vec3(0.0f) && glm::dot(n, sun.direction_to_light) <= 0.0f) continue;
        const float visible = lights ? lights->ofSun(i, sample) : 1.0f;
        if (visible > 0.0f) addLight(sun.direction_to_light, sun.irradiance * visible);
    }
    if (!lighting.points.empty()) {
        const Vec3 from_eye = view.world_from_camera * sample.position_camera;
        for (size_t i = 0; i < lighting.points.size(); ++i) {
            const PointLight& light = lighting.points[i];
            // Relative to the eye, so that floats do far from the origin too.
            const Vec3 to_light = Vec3(light.position - view.eye_world) - from_eye;
            const Vec3 irradiance = incidentLight(light, to_light);
            if (irradiance == Vec3(0.0f)) continue;
            if (through == Vec3(0.0f) && glm::dot(n, to_light) <= 0.0f) continue;
            const float visible = lights ? lights->ofLamp(i, sample) : 1.0f;
            if (visible > 0.0f) addLight(glm::normalize(to_light), irradiance * visible);
        }
    }
    if (lighting.sky.haze_distance > 0.0f) {
        const float distance = glm::length(sample.position_camera);
        radiance = glm::mix(lighting.sky.horizon, radiance,
                            std::exp(-distance / lighting.sky.haze_distance));
    }
    return radiance;
}

}  // namespace stipple
