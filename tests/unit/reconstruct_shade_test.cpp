// SPDX-License-Identifier: Apache-2.0
// The surface's reflection against closed forms and integrals over the hemisphere.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <reconstruct/shade.h>

namespace stipple {
namespace {

const Vec3 kNormal(0.0f, 1.0f, 0.0f);

Vec3 directionAt(double cosine, double azimuth) {
    const double s = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
    return Vec3(DVec3(s * std::cos(azimuth), cosine, s * std::sin(azimuth)));
}

SurfaceFinish finishOf(float metallic, float roughness, float specular) {
    SurfaceFinish f;
    f.metallic = metallic;
    f.roughness = roughness;
    f.specular = Vec3(specular);
    return f;
}

// Shares of the light from every direction, weighted by the cosine, that go to the eye: x diffuse,
// y specular. Half vectors are spread as the lobe is wide, light directions evenly.
DVec2 reflectedShares(const Vec3& albedo, const SurfaceFinish& finish, const Vec3& to_eye) {
    constexpr int kSteps = 300;
    const double a = std::max(double(finish.roughness) * finish.roughness, 1e-3), a2 = a * a;
    DVec2 sum(0.0);
    for (int i = 0; i < kSteps; ++i) {
        for (int j = 0; j < kSteps; ++j) {
            const double u = (i + 0.5) / kSteps, azimuth = 2.0 * kPi * (j + 0.5) / kSteps;
            const Vec3 even = directionAt(std::sqrt(u), azimuth);  // density cosine / pi
            sum.x += kPi * evaluateBrdf(albedo, finish, kNormal, even, to_eye).diffuse.x;
            // Density D(h) (n.h) of half vectors, over 4 (v.h) of the light's directions.
            const double cosine = std::sqrt((1.0 - u) / (1.0 + (a2 - 1.0) * u));
            const Vec3 half = directionAt(cosine, azimuth);
            const float v_h = glm::dot(to_eye, half);
            const Vec3 light = 2.0f * v_h * half - to_eye;
            if (v_h <= 0.0f || light.y <= 0.0f) continue;
            const double spread = 1.0 - cosine * cosine * (1.0 - a2);
            const double density = a2 / (kPi * spread * spread) * cosine / (4.0 * v_h);
            sum.y +=
                evaluateBrdf(albedo, finish, kNormal, glm::normalize(light), to_eye).specular.x *
                light.y / density;
        }
    }
    return sum / double(kSteps * kSteps);
}

TEST(ReconstructShade, atNormalIncidenceTheLobeHasItsClosedForm) {
    for (const float roughness : {0.3f, 0.5f, 1.0f}) {
        for (const float metallic : {0.0f, 0.25f, 1.0f}) {
            const Vec3 albedo(0.8f, 0.4f, 0.2f);
            const Brdf brdf = evaluateBrdf(albedo, finishOf(metallic, roughness, 0.04f), kNormal,
                                           kNormal, kNormal);
            const double a2 = std::pow(double(roughness), 4.0);
            const auto mirrored = [&](int c) {
                return 0.04 * (1.0 - metallic) + metallic * double(albedo[c]);
            };
            for (int c = 0; c < 3; ++c) {
                const double expected = mirrored(c) / (4.0 * kPi * a2);
                EXPECT_NEAR(brdf.specular[c], expected, 1e-5 * expected);
                EXPECT_NEAR(brdf.diffuse[c],
                            albedo[c] * (1.0 - metallic) * (1.0 - mirrored(0)) / kPi, 1e-6);
            }
        }
    }
}

TEST(ReconstructShade, lightAndEyeMayChangePlaces) {
    Rng rng{3};
    for (int i = 0; i < 1000; ++i) {
        const SurfaceFinish finish =
            finishOf(float(rng.uniform(0, 1)), float(rng.uniform(0.05, 1)), 0.05f);
        const Vec3 a = directionAt(rng.uniform(0.01, 1), rng.uniform(0, 6)),
                   b = directionAt(rng.uniform(0.01, 1), rng.uniform(0, 6));
        const Vec3 albedo(0.7f, 0.5f, 0.1f);
        const Brdf one = evaluateBrdf(albedo, finish, kNormal, a, b),
                   other = evaluateBrdf(albedo, finish, kNormal, b, a);
        for (int c = 0; c < 3; ++c) {
            EXPECT_NEAR(one.specular[c], other.specular[c], 1e-4f * (1e-3f + one.specular[c]));
            EXPECT_NEAR(one.diffuse[c], other.diffuse[c], 1e-6f);
        }
    }
}

TEST(ReconstructShade, theLobeReflectsNoMoreThanItReceives) {
    for (const float roughness : {0.1f, 0.3f, 0.6f, 1.0f}) {
        for (const double cosine : {1.0, 0.9, 0.3, 0.1}) {
            const Vec3 eye = directionAt(cosine, 0.0);
            const DVec2 metal = reflectedShares(Vec3(1), finishOf(1, roughness, 0.04f), eye);
            EXPECT_LE(metal.y, 1.001) << roughness << " " << cosine;
            EXPECT_EQ(metal.x, 0.0);
            if (roughness <= 0.3f && cosine >= 0.3) {
                EXPECT_GE(metal.y, 0.94);
            }
            // Appendix B's diffuse part knows only the half angle: seen at a slant both parts may
            // add up to more.
            if (cosine < 0.9) continue;
            const DVec2 white = reflectedShares(Vec3(1), finishOf(0, roughness, 0.04f), eye);
            EXPECT_LE(white.x + white.y, 1.001) << roughness << " " << cosine;
            EXPECT_GE(white.x + white.y, 0.85);
        }
    }
}

TEST(ReconstructShade, withoutReflectanceItIsLambert) {
    const Vec3 eye = directionAt(0.1, 0.0);
    for (const double cosine : {1.0, 0.05}) {
        const Brdf brdf = evaluateBrdf(Vec3(0.5f), finishOf(0, 0.2f, 0.0f), kNormal,
                                       directionAt(cosine, 3.0), eye);
        EXPECT_EQ(brdf.specular, Vec3(0.0f));
        EXPECT_NEAR(brdf.diffuse.x, 0.5 / kPi, 1e-6);
    }
}

TEST(ReconstructShade, nothingIsReflectedThroughTheSurface) {
    const Vec3 above = directionAt(0.5, 0.0), below = directionAt(-0.5, 0.0);
    for (const auto& [light, eye] : {std::pair{above, below}, {below, above}, {below, below}}) {
        const Brdf brdf = evaluateBrdf(Vec3(1), finishOf(0.5f, 0.5f, 0.04f), kNormal, light, eye);
        EXPECT_EQ(brdf.diffuse, Vec3(0.0f));
        EXPECT_EQ(brdf.specular, Vec3(0.0f));
    }
}

TEST(ReconstructShade, evenSurroundingsAreMirroredAsTheLobeHasIt) {
    Lighting lighting;
    lighting.sky.zenith = lighting.sky.horizon = lighting.sky.ground = Vec3(1.0f);
    View view;
    view.turnTo(DMat3(1.0));
    for (const float metallic : {0.0f, 1.0f}) {
        for (const float roughness : {0.2f, 0.5f, 0.9f}) {
            for (const double cosine : {1.0, 0.6, 0.3}) {
                const Vec3 eye = directionAt(cosine, 0.0);
                SurfaceSample sample;
                sample.position_camera = -eye;
                sample.normal_world = kNormal;
                sample.albedo = Vec3(metallic);  // a black dielectric: the lobe alone
                sample.finish = finishOf(metallic, roughness, 0.04f);
                const double shown = shade(sample, Material(), lighting, view).x;
                const double expected = reflectedShares(sample.albedo, sample.finish, eye).y;
                EXPECT_NEAR(shown, expected, 0.005 + 0.02 * expected)
                    << metallic << " " << roughness << " " << cosine;
            }
        }
    }
}

TEST(ReconstructShade, aSunsHighlightIsTheLobeTimesItsIrradiance) {
    Lighting lighting;
    lighting.sky.zenith = lighting.sky.horizon = lighting.sky.ground = Vec3(0.0f);
    const Vec3 light = directionAt(0.8, 0.3), eye = directionAt(0.7, 2.0);
    lighting.suns.push_back({light, Vec3(2.0f)});
    View view;
    view.turnTo(DMat3(1.0));
    SurfaceSample sample;
    sample.position_camera = -3.0f * eye;
    sample.normal_world = kNormal;
    sample.albedo = Vec3(0.6f, 0.3f, 0.1f);
    sample.finish = finishOf(0.3f, 0.4f, 0.04f);
    sample.finish.emissive = Vec3(0.0f, 0.0f, 5.0f);
    const Brdf brdf = evaluateBrdf(sample.albedo, sample.finish, kNormal, light, eye);
    const Vec3 expected = (brdf.diffuse + brdf.specular) * (2.0f * 0.8f) + sample.finish.emissive;
    const Vec3 shown = shade(sample, Material(), lighting, view);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(shown[c], expected[c], 1e-5f);
    // Of a leaf, half of what is scattered comes through: less here, the rest from behind.
    Material leaf;
    leaf.translucency = 0.5f;
    sample.finish = SurfaceFinish();
    EXPECT_NEAR(shade(sample, leaf, lighting, view).x, 0.5 * 0.6 * 1.6 / kPi, 1e-5);
    lighting.suns[0].direction_to_light.y = -0.8f;
    EXPECT_NEAR(shade(sample, leaf, lighting, view).x, 0.5 * 0.6 * 1.6 / kPi, 1e-5);
}

}  // namespace
}  // namespace stipple
