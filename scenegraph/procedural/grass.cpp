// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <core/rng.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/season.h>
#include <scenegraph/procedural/stem.h>

namespace stipple {

namespace {

// A blade: a strip of 5 triangles that rises, bends over and narrows to a point, folded a little
// along its length.
void appendBlade(Mesh& mesh, Rng& rng, const Vec3& root, const Vec3& lean_direction, float length,
                 float width) {
    const Vec3 lean = glm::normalize(lean_direction);
    const float start = uniform(rng, 0.03, 0.5);  // from upright, radians
    const float bend = uniform(rng, 0.3, 1.9);    // more, up to the tip
    const float turn = uniform(rng, -0.6, 0.6);
    const Vec3 across(lean.z * std::cos(turn) + lean.x * std::sin(turn), 0.0f,
                      -lean.x * std::cos(turn) + lean.z * std::sin(turn));
    const float dryness = uniform(rng, 0.0, 1.0), value = uniform(rng, 0.72, 1.0);
    const Vec3 tint =
        glm::mix(Vec3(0.8f, 1.0f, 0.75f), Vec3(1.0f, 0.84f, 0.62f), dryness * dryness * dryness) *
        value;

    constexpr int kSegments = 3;
    const uint32_t first = uint32_t(mesh.positions.size());
    Vec3 p = root;
    for (int i = 0; i <= kSegments; ++i) {
        const float t = float(i) / float(kSegments);
        const float angle = start + bend * t * t;
        const Vec3 along = lean * std::sin(angle) + Vec3(0, 1, 0) * std::cos(angle);
        const Vec3 normal = glm::cross(along, across);
        // Half upwards: light falls on grass as on a meadow, not as on single blades.
        const Vec3 up = Vec3(0, 1, 0) * 0.8f;
        const Vec3 color = tint * glm::mix(0.28f, 1.0f, std::sqrt(t)) *
                           glm::mix(Vec3(1.0f), Vec3(1.0f, 0.97f, 0.85f), t);
        const float half = 0.5f * width * (1.0f - 0.35f * t);
        const int corners = i == kSegments ? 1 : 2;
        for (int c = 0; c < corners; ++c) {
            const float hand = corners == 1 ? 0.0f : c == 0 ? -1.0f : 1.0f;
            mesh.positions.push_back(p + across * (hand * half));
            mesh.normals.push_back(glm::normalize(normal * (normal.y < 0.0f ? -0.5f : 0.5f) +
                                                  across * (hand * 0.2f) + up));
            mesh.colors.push_back(Vec4(color, 1.0f));
        }
        p += along * (length / float(kSegments));
    }
    for (uint32_t i = 0; i < kSegments; ++i) {
        const uint32_t a = first + 2 * i;
        mesh.triangles.push_back(UVec3(a, a + 1, a + 2));
        if (i + 1 < kSegments) mesh.triangles.push_back(UVec3(a + 1, a + 3, a + 2));
    }
}

}  // namespace

GeneratedMesh makeGrass(const GrassParams& params) {
    if (params.blades < 1 || params.blades > 200000) {
        throw Error(ErrorCode::kInvalidArgument, "", "a grass tuft's blades must be in 1..200000");
    }
    if (!(params.height >= 1e-3 && params.height <= 1e3 && params.radius >= 0.0 &&
          params.radius <= 1e3)) {
        throw Error(
            ErrorCode::kInvalidArgument, "",
            "a grass tuft's height must be in 0.001..1000 and its radius in 0..1000 metres");
    }
    const Season season = seasonByName(params.season);
    GeneratedMesh result;
    Mesh& mesh = result.mesh;
    mesh.name = "grass";
    Rng rng{hashCombine(params.seed, 0x64a55)};
    // Blades stand in small bunches.
    const int bunches = std::max(1, params.blades / 7);
    std::vector<Vec3> centers;
    for (int i = 0; i < bunches; ++i) {
        const float r = float(params.radius) * uniform(rng, 0.0, 0.85);  // denser in the middle
        const float a = uniform(rng, 0.0, 2.0 * kPi);
        centers.push_back(Vec3(r * std::cos(a), uniform(rng, 0.45, 1.0),
                               r * std::sin(a)));  // y: height of the bunch
    }
    for (int i = 0; i < params.blades; ++i) {
        const Vec3 bunch = centers[size_t(i) % centers.size()];
        const float r = float(params.radius) * 0.2f * std::sqrt(uniform(rng, 0.0, 1.0));
        const float a = uniform(rng, 0.0, 2.0 * kPi);
        const Vec3 away(std::cos(a), 0.0f, std::sin(a));
        const Vec3 root = Vec3(bunch.x, -0.02f * float(params.height), bunch.z) + away * r;
        // The first blade is the longest one.
        const float length =
            float(params.height) * (i == 0 ? 1.0f : bunch.y * uniform(rng, 0.55, 1.0));
        const float width = float(params.height) * uniform(rng, 0.024, 0.046);
        const float stray = uniform(rng, 0.0, 2.0 * kPi);
        appendBlade(mesh, rng, root,
                    away + 0.6f * Vec3(std::cos(stray), 0.0f, std::sin(stray)) + Vec3(1e-4f, 0, 0),
                    length, width);
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    Material material;
    material.name = "grass";
    switch (season) {
        case Season::kSpring:
            material.base_color = Vec3(0.2f, 0.31f, 0.055f);
            break;
        case Season::kSummer:
            material.base_color = Vec3(0.21f, 0.27f, 0.065f);
            break;
        case Season::kAutumn:
            material.base_color = Vec3(0.3f, 0.27f, 0.09f);
            break;
        case Season::kWinter:
            material.base_color = Vec3(0.33f, 0.265f, 0.14f);
            break;
    }
    material.double_sided = true;
    material.translucency = 0.4f;
    result.materials.push_back(material);
    return result;
}

}  // namespace stipple
