// SPDX-License-Identifier: Apache-2.0
// What compressed glTF files hold: EXT_meshopt_compression (meshoptimizer) and
// KHR_draco_mesh_compression (Draco). Internal to the glTF loader.
#pragma once

#include <scenegraph/io/gltf_document.h>

#include <map>
#include <string>
#include <vector>

namespace stipple {

// Decodes every buffer view with EXT_meshopt_compression into document.decoded_views. Throws
// kInvalidScene for damaged data, kOutOfMemory before the memory is taken.
void decodeMeshoptViews(GltfDocument& document);

struct DracoAttribute {
    int components = 0;
    std::vector<float> values;  // count x components; normalized integers are scaled
};

struct DracoPrimitive {
    size_t vertex_count = 0;
    std::vector<uint32_t> indices;  // of triangles
    std::map<std::string, DracoAttribute> attributes;
};

// Decodes what the primitive's KHR_draco_mesh_compression names. path: of the primitive. Throws as
// above, also for values that are not finite.
DracoPrimitive decodeDraco(const GltfDocument& document, const tinygltf::Primitive& primitive,
                           const std::string& path);

}  // namespace stipple
