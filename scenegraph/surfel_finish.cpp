// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/surfel_finish.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr uint32_t kMostMaterials = 256, kFinishesEach = 16;

bool areManyMaterials(const std::vector<Material>& materials) {
    return materials.size() * kFinishesEach > size_t(kMostMaterials);
}

}  // namespace

uint32_t finishKey(const std::vector<Material>& materials, uint32_t material_index,
                   const SurfaceFinish& finish) {
    const auto level = [](float v, int n) {
        return uint32_t(std::lround(std::clamp(v, 0.0f, 1.0f) * float(n)));
    };
    const uint32_t material = material_index % kMostMaterials;
    const Material& m = materials[material_index];
    if (areManyMaterials(materials)) return material << 8;
    const float most = std::max({m.emissive.x, m.emissive.y, m.emissive.z, 1e-6f});
    const float shines = std::max({finish.emissive.x, finish.emissive.y, finish.emissive.z}) / most;
    return material << 8 | level(finish.metallic, 1) << 4 | level(finish.roughness, 3) << 1 |
           level(shines, 1);
}

SurfelFinish makeFinish(const std::vector<Material>& materials,
                        const std::vector<float>& patch_width, uint32_t key) {
    const Material& from = materials[key >> 8];
    SurfelFinish finish;
    Material& m = finish.material;
    m.name = from.name;
    m.double_sided = from.double_sided;
    m.translucency = from.translucency;
    m.unlit = from.unlit;
    m.specular = from.specular;
    m.specular_weight = from.specular_weight;
    finish.patch_width = patch_width[key >> 8];
    if (from.isTextured() && !areManyMaterials(materials)) {
        m.metallic = float(key >> 4 & 1);
        m.roughness = float(key >> 1 & 3) / 3.0f;
        m.emissive = from.emissive * float(key & 1);
    } else {
        m.metallic = from.metallic;
        m.roughness = from.roughness;
        m.emissive = from.emissive;
    }
    return finish;
}

std::vector<SurfelFinish> makeFinishes(const std::vector<Material>& materials,
                                       const std::vector<float>& patch_width,
                                       std::map<uint32_t, uint8_t>& index_of) {
    std::vector<SurfelFinish> finishes;
    for (auto& [key, index] : index_of) {
        index = uint8_t(finishes.size());
        finishes.push_back(makeFinish(materials, patch_width, key));
    }
    return finishes;
}

std::vector<float> materialPatchWidths(const Scene& scene) {
    std::vector<double> width(scene.materials.size(), 0.0), area(scene.materials.size(), 1e-30);
    for (const Mesh& mesh : scene.meshes) {
        if (mesh.is_patch) continue;
        for (size_t t = 0; t < mesh.triangles.size(); ++t) {
            const double a = mesh.cumulative_area[t + 1] - mesh.cumulative_area[t];
            const uint16_t m = mesh.triangle_material[t];
            width[m] += a * double(mesh.strata[mesh.triangle_stratum[t]].patch_width);
            area[m] += a;
        }
    }
    std::vector<float> result;
    for (size_t m = 0; m < width.size(); ++m)
        result.push_back(float(std::min(width[m] / area[m], 1e12)));
    return result;
}

}  // namespace stipple
