// SPDX-License-Identifier: Apache-2.0
// The vertices of one glTF primitive on their way into a mesh. Internal to the glTF loader.
#pragma once

#include <scenegraph/io/gltf_compression.h>
#include <scenegraph/io/gltf_mesh.h>

#include <optional>

namespace stipple {

struct GltfPrimitive {
    std::vector<Vec3> positions, normals;  // normals may be empty
    std::vector<Vec4> tangents, colors;    // may be empty
    std::vector<std::vector<Vec2>> uvs;    // layers of the material; each may be empty
    std::vector<UVec3> triangles;
    uint16_t material = 0;

    // Calls visit(array) for every array of one value a vertex that is not empty.
    template <class Visit>
    void forEachArray(const Visit& visit) {
        const auto visitIfAny = [&](auto& array) {
            if (!array.empty()) visit(array);
        };
        visitIfAny(positions), visitIfAny(normals), visitIfAny(tangents), visitIfAny(colors);
        for (auto& layer : uvs) visitIfAny(layer);
    }
};

template <class V>
std::vector<V> asVectors(const std::vector<float>& values) {
    std::vector<V> result(values.size() / V::length());
    for (size_t i = 0; i < result.size(); ++i) {
        for (int c = 0; c < V::length(); ++c) result[i][c] = values[i * V::length() + c];
    }
    return result;
}

// Accessor `index` as vectors. Throws if it has another count than `n_vertices`.
template <class V>
std::vector<V> readVectors(const GltfDocument& document, int index,
                           std::initializer_list<int> types, float fill, size_t n_vertices,
                           const std::string& place) {
    const size_t count = accessorCount(document, index, types, place);
    if (count != n_vertices) {
        document.fail(
            ErrorCode::kInvalidScene, place,
            "count " + std::to_string(count) + ", but POSITION has " + std::to_string(n_vertices));
    }
    return asVectors<V>(readFloats(document, index, V::length(), fill, place));
}

// Throws kInvalidScene if a position is too far out to be drawn.
void checkPositions(const GltfDocument& document, const std::vector<Vec3>& positions,
                    const std::string& place);

// Moves the vertices: morph targets by their weights, then the skin's joints by JOINTS_n and
// WEIGHTS_n. path: of the primitive.
void applyPose(const GltfDocument& document, const tinygltf::Primitive& source,
               const GltfPose& pose, const std::string& path, GltfPrimitive& primitive);

}  // namespace stipple
