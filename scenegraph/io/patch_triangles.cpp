// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/patch_triangles.h>

#include <meshoptimizer.h>
#include <algorithm>
#include <map>

namespace stipple {

namespace {

constexpr size_t kFewTriangles = 8;  // are not simplified
constexpr float kMostError = 0.25f;  // of a part's size

// The triangles of one material, with the vertices they use.
struct Part {
    uint16_t material = 0;
    std::vector<uint32_t> vertices;  // of the mesh
    std::vector<unsigned int> indices;
    std::vector<Vec3> positions;
    float scale = 0.0f;  // of meshoptimizer's errors, m
    bool varies = false;
};

std::vector<Part> partsOf(const Mesh& mesh, const std::vector<Material>& materials,
                          const std::vector<uint32_t>& triangles) {
    std::map<uint16_t, Part> parts;
    std::map<std::pair<uint16_t, uint32_t>, uint32_t> index_of;
    for (const uint32_t t : triangles) {
        const uint16_t material = mesh.triangle_material[t];
        Part& part = parts[material];
        part.material = material;
        for (int k = 0; k < 3; ++k) {
            const uint32_t v = mesh.triangles[t][k];
            const auto [at, is_new] =
                index_of.emplace(std::pair(material, v), uint32_t(part.vertices.size()));
            if (is_new) {
                part.vertices.push_back(v);
                part.positions.push_back(mesh.positions[v]);
                if (!mesh.colors.empty() && mesh.colors[v] != mesh.colors[part.vertices.front()])
                    part.varies = true;
            }
            part.indices.push_back(at->second);
        }
    }
    std::vector<Part> result;
    for (auto& [material, part] : parts) {
        part.varies = part.varies || materials[material].isTextured();
        part.scale =
            meshopt_simplifyScale(&part.positions[0].x, part.positions.size(), sizeof(Vec3));
        result.push_back(std::move(part));
    }
    return result;
}

void addTriangles(const Part& part, const std::vector<unsigned int>& indices,
                  TriangleLevel& level) {
    for (size_t i = 0; i + 2 < indices.size(); i += 3) {
        level.triangles.emplace_back(part.vertices[indices[i]], part.vertices[indices[i + 1]],
                                     part.vertices[indices[i + 2]]);
        level.material.push_back(part.material);
    }
}

}  // namespace

std::vector<TriangleLevel> simplifyPatch(const Mesh& mesh, const std::vector<Material>& materials,
                                         const std::vector<uint32_t>& triangles) {
    const std::vector<Part> parts = partsOf(mesh, materials, triangles);
    std::vector<TriangleLevel> levels(1);
    for (const Part& part : parts) addTriangles(part, part.indices, levels[0]);
    for (int l = 1;; ++l) {
        TriangleLevel level;
        for (const Part& part : parts) {
            const size_t target = std::max((part.indices.size() / 3) >> l, kFewTriangles) * 3;
            if (part.varies || part.indices.size() <= target) {
                addTriangles(part, part.indices, level);
                continue;
            }
            std::vector<unsigned int> indices(part.indices.size());
            float error = 0.0f;
            indices.resize(meshopt_simplify(indices.data(), part.indices.data(),
                                            part.indices.size(), &part.positions[0].x,
                                            part.positions.size(), sizeof(Vec3), target, kMostError,
                                            meshopt_SimplifyLockBorder, &error));
            level.error = std::max(level.error, error * part.scale);
            addTriangles(part, indices, level);
        }
        if (level.triangles.empty() ||
            level.triangles.size() > levels.back().triangles.size() * 4 / 5)
            return levels;
        level.error = std::max(level.error, levels.back().error);
        levels.push_back(std::move(level));
    }
}

}  // namespace stipple
