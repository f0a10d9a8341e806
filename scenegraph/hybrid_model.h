// SPDX-License-Identifier: Apache-2.0
// Hybrid models: the surface in patches, each as triangles and as surfels, both at several
// densities. Made by io/hybrid.h, read and written by io/hybrid_file.h; sampling/patch_choice.h
// chooses by what a patch is drawn. Based on: Ni. Hybrid Triangle/Point Models. 2005.
#pragma once

#include <scenegraph/scene.h>

namespace stipple {

// A patch's triangles at one density. The patch's border is the same at all of them.
struct TriangleLevel {
    float error = 0.0f;            // object space, m: how far it is from the finest
    std::vector<UVec3> triangles;  // of HybridModel::mesh's vertices
    std::vector<uint16_t> material;
};

// At least one of both lists holds something.
struct HybridPatch {
    std::vector<TriangleLevel> triangles;  // finest first
    // Finest first, each with about half the surfels of the last, all of which the last has too.
    std::vector<SurfelLevel> surfels;
};

struct HybridModel {
    std::string source;  // name of the file it was made from
    Mesh mesh;           // vertices alone
    std::vector<Material> materials;
    std::vector<Texture> textures;       // level 0 alone; of the materials
    std::vector<SurfelFinish> finishes;  // of the surfels
    // The whole surface, what rays meet and what is drawn far away.
    std::vector<UVec3> triangles;
    std::vector<uint16_t> triangle_material;
    std::vector<HybridPatch> patches;
};

// Throws kParse (where: names the file) unless indices, counts and numbers make sense.
void checkHybridModel(const HybridModel& model, const std::string& where);

// Adds it to a scene that is being loaded, as one mesh with patches (Mesh::patches). Throws
// kUnsupported for too many materials.
ChildRef addHybridModel(Scene& scene, HybridModel model, const std::string& name);

}  // namespace stipple
