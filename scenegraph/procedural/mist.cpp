// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/stem.h>

#include <cmath>

namespace stipple {

GeneratedMesh makeMist(const MistParams& params) {
    if (params.patches < 1 || params.patches > 2000000)
        throw Error(ErrorCode::kInvalidArgument, "", "mist's patches must be in 1..2000000");
    if (!(params.radius >= 1e-3 && params.radius <= 1e5)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "mist's radius must be in 0.001..100000 metres");
    }
    if (!(params.depth > 0.0 && params.depth <= 100.0))
        throw Error(ErrorCode::kInvalidArgument, "", "mist's depth must be in 0..100");
    // A square turned at random covers half its area on average. A ray through the middle meets
    // N / 2 side^2 (15 / (8 pi R^3)) 2 R (2 / 3) of them, for a density of 1 - (r / R)^2.
    const double met = double(params.patches) * params.patch * params.patch /
                       (params.radius * params.radius) * 5.0 / (4.0 * kPi);
    // The number met varies as that of independent squares does, so exp(-depth) comes through.
    const double alpha = params.depth / met;
    if (!(alpha <= 1.0)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "mist of this depth needs more or larger patches: a ray meets only " +
                        std::to_string(met));
    }
    GeneratedMesh result;
    Mesh& mesh = result.mesh;
    mesh.name = "mist";
    mesh.positions.reserve(4 * size_t(params.patches));
    Rng rng{hashCombine(params.seed, 0x6d1)};
    for (int i = 0; i < params.patches; ++i) {
        Vec3 p;
        float r2;
        do {
            p = Vec3(uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0));
            r2 = glm::dot(p, p);
        } while (r2 >= 1.0f || uniform(rng, 0.0, 1.0) > 1.0f - r2);
        p *= float(params.radius);
        const Vec3 n = randomUnit(rng);
        const Vec3 any = std::abs(n.y) < 0.9f ? Vec3(0, 1, 0) : Vec3(1, 0, 0);
        const float half = 0.5f * float(params.patch);
        const Vec3 u = glm::normalize(glm::cross(n, any)) * half, v = glm::cross(n, u);
        const uint32_t first = uint32_t(mesh.positions.size());
        for (const Vec3& corner : {p - u - v, p + u - v, p + u + v, p - u + v}) {
            mesh.positions.push_back(corner);
            // Lit as one body, not square by square.
            mesh.normals.push_back(Vec3(0, 1, 0));
        }
        mesh.triangles.push_back(UVec3(first, first + 1, first + 2));
        mesh.triangles.push_back(UVec3(first, first + 2, first + 3));
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    Material& material = result.materials.emplace_back();
    material.name = "mist";
    material.base_color = params.color;
    material.alpha = float(alpha);
    material.alpha_mode = AlphaMode::kBlend;
    material.double_sided = true;
    material.translucency = 0.5f;
    return result;
}

}  // namespace stipple
