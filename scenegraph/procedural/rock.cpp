// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <core/rng.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/stem.h>

#include <unordered_map>

namespace stipple {

namespace {

// Unit icosphere: every triangle of an icosahedron split into 4, `subdivisions` times.
void appendIcosphere(Mesh& mesh, int subdivisions) {
    const float g = 0.5f * (1.0f + std::sqrt(5.0f));
    for (const Vec3& p : {Vec3(-1, g, 0), Vec3(1, g, 0), Vec3(-1, -g, 0), Vec3(1, -g, 0),
                          Vec3(0, -1, g), Vec3(0, 1, g), Vec3(0, -1, -g), Vec3(0, 1, -g),
                          Vec3(g, 0, -1), Vec3(g, 0, 1), Vec3(-g, 0, -1), Vec3(-g, 0, 1)}) {
        mesh.positions.push_back(glm::normalize(p));
    }
    mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                      {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                      {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                      {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    for (int level = 0; level < subdivisions; ++level) {
        std::unordered_map<uint64_t, uint32_t> middles;  // of edges, by their ends
        middles.reserve(mesh.triangles.size() * 3 / 2);
        const auto middle = [&](uint32_t a, uint32_t b) {
            const auto [it, is_new] = middles.try_emplace(
                uint64_t(std::min(a, b)) << 32 | std::max(a, b), uint32_t(mesh.positions.size()));
            if (is_new)
                mesh.positions.push_back(glm::normalize(mesh.positions[a] + mesh.positions[b]));
            return it->second;
        };
        std::vector<UVec3> split;
        split.reserve(mesh.triangles.size() * 4);
        for (const UVec3& t : mesh.triangles) {
            const uint32_t a = middle(t.x, t.y), b = middle(t.y, t.z), c = middle(t.z, t.x);
            split.insert(split.end(),
                         {UVec3(t.x, a, c), UVec3(t.y, b, a), UVec3(t.z, c, b), UVec3(a, b, c)});
        }
        mesh.triangles = std::move(split);
    }
}

void addSmoothNormals(Mesh& mesh) {
    mesh.normals.assign(mesh.positions.size(), Vec3(0.0f));
    for (const UVec3& t : mesh.triangles) {
        const Vec3 n = glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                                  mesh.positions[t.z] - mesh.positions[t.x]);
        for (int i = 0; i < 3; ++i) mesh.normals[t[i]] += n;
    }
    for (size_t i = 0; i < mesh.normals.size(); ++i) {
        const float length = glm::length(mesh.normals[i]);
        mesh.normals[i] =
            length > 0.0f ? mesh.normals[i] / length : glm::normalize(mesh.positions[i]);
    }
}

}  // namespace

GeneratedMesh makeRock(const RockParams& params) {
    if (params.subdivisions < 0 || params.subdivisions > 8) {
        throw Error(ErrorCode::kInvalidArgument, "", "a rock's subdivisions must be in 0..8");
    }
    if (!(params.radius >= 1e-4 && params.radius <= 1e5)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a rock's radius must be in 0.0001..100000 metres");
    }
    GeneratedMesh result;
    Mesh& mesh = result.mesh;
    mesh.name = "rock";
    appendIcosphere(mesh, params.subdivisions);

    Rng rng{hashCombine(params.seed, 0x40c4)};
    const float wide = uniform(rng, 0.8, 1.0), high = uniform(rng, 0.55, 0.8);
    const Vec3 stretch(1.0f, high, wide);
    // Rocks break along planes: what stands out beyond one is pushed back onto it, with a rounded
    // edge.
    struct Plane {
        Vec3 normal;
        float distance;
    };
    std::vector<Plane> planes(14);
    for (Plane& plane : planes) {
        plane.normal = randomUnit(rng);
        plane.distance = uniform(rng, 0.62, 0.92);
    }
    const uint64_t key = rng.next();
    mesh.colors.resize(mesh.positions.size());
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 d = mesh.positions[i];
        float r = 1.0f + 0.25f * float(gradientNoise(key, DVec3(d) * 1.1));
        for (const Plane& plane : planes) {
            const float facing = glm::dot(plane.normal, d);
            if (facing > 0.05f) r -= 0.93f * std::max(0.0f, r - plane.distance / facing);
        }
        const double bumps = fractalNoise(key + 100, DVec3(d) * 2.2, 6);
        const double ridges = 1.0 - std::abs(fractalNoise(key + 200, DVec3(d) * 1.7, 4));
        r += 0.1f * float(bumps) + 0.1f * float(ridges * ridges - 0.7);
        mesh.positions[i] = d * r * stretch;
        mesh.colors[i].w = float(
            bumps + 0.8 * (ridges - 0.8));  // kept for the colour below: height above the surface
    }
    float largest = 0.0f;
    for (const Vec3& p : mesh.positions) largest = std::max(largest, glm::length(p));
    addSmoothNormals(mesh);
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 p = mesh.positions[i] / largest, n = mesh.normals[i];
        const float raised = mesh.colors[i].w;
        const float grain = float(fractalNoise(key + 300, DVec3(p) * 9.0, 3));
        Vec3 color =
            glm::mix(Vec3(0.52f, 0.49f, 0.45f), Vec3(0.72f, 0.69f, 0.64f), 0.5f + 0.5f * grain);
        color *= 0.55f + 0.45f * float(smoothStep(-0.5, 0.3, raised));  // dark crevices
        color *= 0.6f + 0.4f * float(smoothStep(-0.9, 0.3, n.y));       // dark, moist underside
        const double lichen = fractalNoise(key + 400, DVec3(p) * 5.0, 4);
        color =
            glm::mix(color, Vec3(0.75f, 0.76f, 0.62f), 0.6f * float(smoothStep(0.22, 0.4, lichen)));
        const double moss =
            n.y + 0.9 * fractalNoise(key + 500, DVec3(p) * 2.5, 4) - 0.4 * double(raised);
        color =
            glm::mix(color, Vec3(0.2f, 0.27f, 0.07f), 0.85f * float(smoothStep(0.75, 1.15, moss)));
        mesh.colors[i] = Vec4(glm::clamp(color, Vec3(0.0f), Vec3(1.0f)), 1.0f);
        mesh.positions[i] = p * float(params.radius);
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    Material material;
    material.name = "rock";
    material.base_color = Vec3(0.55f);
    result.materials.push_back(material);
    return result;
}

}  // namespace stipple
