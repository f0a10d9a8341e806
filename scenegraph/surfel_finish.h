// SPDX-License-Identifier: Apache-2.0
// What builders of surfels share: the few finishes that stand for materials and their textures.
#pragma once

#include <core/surface.h>
#include <scenegraph/scene.h>

#include <map>

namespace stipple {

// Names a finish: material, and what its textures made of it, coarsely.
uint32_t finishKey(const std::vector<Material>& materials, uint32_t material,
                   const SurfaceFinish& finish);

// Makes the finishes of the keys, in their order; the map's values become their indices. Of more
// than 256 those of one material are joined; if that is not enough, those of materials that are
// alike, but never what is seen from one side with what is seen from both, nor lit with unlit.
// patch_width: by material, as materialPatchWidths().
std::vector<SurfelFinish> makeFinishes(const std::vector<Material>& materials,
                                       const std::vector<float>& patch_width,
                                       std::map<uint32_t, uint8_t>& index_of);

// Mean width of what each material's surface is connected to, by area. The meshes have been built.
std::vector<float> materialPatchWidths(const Scene& scene);

}  // namespace stipple
