// SPDX-License-Identifier: Apache-2.0
// What builders of surfels share: the few finishes that stand for materials and their textures.
#pragma once

#include <core/surface.h>
#include <scenegraph/scene.h>

#include <map>

namespace stipple {

// Names a finish: material, and what its textures made of it, coarsely; of very many materials
// nothing but the material.
uint32_t finishKey(const std::vector<Material>& materials, uint32_t material,
                   const SurfaceFinish& finish);

// What a key stands for. patch_width: by material, as materialPatchWidths().
SurfelFinish makeFinish(const std::vector<Material>& materials,
                        const std::vector<float>& patch_width, uint32_t key);

// Makes the finishes of the keys, in their order; the map's values become their indices.
std::vector<SurfelFinish> makeFinishes(const std::vector<Material>& materials,
                                       const std::vector<float>& patch_width,
                                       std::map<uint32_t, uint8_t>& index_of);

// Mean width of what each material's surface is connected to, by area. The meshes have been built.
std::vector<float> materialPatchWidths(const Scene& scene);

}  // namespace stipple
