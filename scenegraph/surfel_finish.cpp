// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/surfel_finish.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace stipple {

namespace {

constexpr size_t kMostFinishes = 256;

// What a key stands for; is_whole: its material, whatever textures make of it.
SurfelFinish makeFinish(const std::vector<Material>& materials,
                        const std::vector<float>& patch_width, uint32_t key, bool is_whole) {
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
    m.metallic = from.metallic;
    m.roughness = from.roughness;
    m.emissive = from.emissive;
    if (is_whole) return finish;
    if (from.metallic_roughness_map.texture != kNoTexture) {
        m.metallic = float(key >> 4 & 1);
        m.roughness = float(key >> 1 & 3) / 3.0f;
    }
    if (from.emissive_map.texture != kNoTexture) m.emissive *= float(key & 1);
    return finish;
}

// What joined materials have in common: values in so many steps.
std::array<int, 12> likeness(const Material& m, int steps) {
    const auto step = [&](float v) {
        return int(std::lround(std::clamp(v, 0.0f, 1.0f) * float(steps)));
    };
    const auto shine = [&](float v) { return step(v / (1.0f + v)); };  // of any strength
    return {m.double_sided,       m.unlit,
            step(m.metallic),     step(m.roughness),
            step(m.translucency), step(m.specular_weight),
            step(m.specular.x),   step(m.specular.y),
            step(m.specular.z),   shine(m.emissive.x),
            shine(m.emissive.y),  shine(m.emissive.z)};
}

std::vector<SurfelFinish> joinFinishes(const std::vector<Material>& materials,
                                       const std::vector<float>& patch_width,
                                       std::map<uint32_t, uint8_t>& index_of) {
    std::map<uint32_t, size_t> class_of;  // materials that there are
    for (const auto& [key, index] : index_of) class_of.emplace(key >> 8, class_of.size());
    size_t n_classes = class_of.size();
    for (int steps = 64; n_classes > kMostFinishes; steps /= 2) {
        std::map<std::array<int, 12>, size_t> classes;
        for (auto& [material, at] : class_of)
            at =
                classes.emplace(likeness(materials[material], steps), classes.size()).first->second;
        n_classes = classes.size();
    }
    // The first of each stands for all.
    std::vector<SurfelFinish> finishes(n_classes);
    std::vector<uint8_t> is_made(n_classes, 0);
    for (auto& [key, index] : index_of) {
        const size_t at = class_of.at(key >> 8);
        if (!is_made[at]) finishes[at] = makeFinish(materials, patch_width, key, true);
        is_made[at] = 1;
        index = uint8_t(at);
    }
    return finishes;
}

}  // namespace

uint32_t finishKey(const std::vector<Material>& materials, uint32_t material_index,
                   const SurfaceFinish& finish) {
    const auto level = [](float v, int n) {
        return uint32_t(std::lround(std::clamp(v, 0.0f, 1.0f) * float(n)));
    };
    const Material& m = materials[material_index];
    const float most = std::max({m.emissive.x, m.emissive.y, m.emissive.z, 1e-6f});
    const float shines = std::max({finish.emissive.x, finish.emissive.y, finish.emissive.z}) / most;
    return material_index << 8 | level(finish.metallic, 1) << 4 | level(finish.roughness, 3) << 1 |
           level(shines, 1);
}

std::vector<SurfelFinish> makeFinishes(const std::vector<Material>& materials,
                                       const std::vector<float>& patch_width,
                                       std::map<uint32_t, uint8_t>& index_of) {
    if (index_of.size() > kMostFinishes) return joinFinishes(materials, patch_width, index_of);
    std::vector<SurfelFinish> finishes;
    for (auto& [key, index] : index_of) {
        index = uint8_t(finishes.size());
        finishes.push_back(makeFinish(materials, patch_width, key, false));
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
