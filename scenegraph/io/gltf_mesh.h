// SPDX-License-Identifier: Apache-2.0
// Meshes of a glTF file. Internal to the glTF loader.
#pragma once

#include <scenegraph/io/gltf_material.h>

namespace stipple {

// What moves a mesh's vertices.
struct GltfPose {
    std::vector<double> morph_weights;    // of the morph targets; empty: none
    std::vector<Affine> world_from_bind;  // of the skin's joints; empty: not skinned
};

// All triangles of meshes[index], primitives merged, points as discs (point_discs.h), in the given
// pose: in world space if it is skinned. A mesh without triangles if it has only lines (with a
// warning). Not yet built.
Mesh loadGltfMesh(const GltfDocument& document, int index, const GltfPose& pose,
                  GltfMaterials& materials);

}  // namespace stipple
