// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/surface_at.h>

namespace stipple {

namespace {

template <class T>
T interpolate(const std::vector<T>& values, const UVec3& t, float u, float v) {
    return values[t.x] * (1.0f - u - v) + values[t.y] * u + values[t.z] * v;
}

// Scaled before it is normalized: edge products of small triangles underflow in float.
Vec3 safeNormalize(const Vec3& v) {
    const float largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return largest > 0.0f ? glm::normalize(v / largest) : v;
}

// A place on a mesh, and looking up textures there.
struct Place {
    const Mesh& mesh;
    const std::vector<Texture>& textures;
    UVec3 t;
    float u, v;
    float footprint_object;

    // The texture coordinates of a layer, nullptr if the mesh has none.
    const std::vector<Vec2>* uvs(int layer) const {
        const std::vector<Vec2>* result = &mesh.uvs;
        if (layer > 0)
            result = size_t(layer) <= mesh.more_uvs.size() ? &mesh.more_uvs[layer - 1] : nullptr;
        return result && !result->empty() ? result : nullptr;
    }

    // False where there is no texture.
    bool lookUp(const TextureUse& use, Vec4& texel) const {
        const std::vector<Vec2>* layer = use.texture == kNoTexture ? nullptr : uvs(use.uv_layer);
        if (!layer) return false;
        float footprint_uv = 0.0f;
        if (footprint_object > 0.0f) {
            // Object space to uv by the ratio of the triangle's areas.
            const Vec3 e1 = mesh.positions[t.y] - mesh.positions[t.x],
                       e2 = mesh.positions[t.z] - mesh.positions[t.x];
            const Vec2 a = (*layer)[t.y] - (*layer)[t.x], b = (*layer)[t.z] - (*layer)[t.x];
            const float object_area = glm::length(glm::cross(e1, e2)),
                        uv_area = std::abs(a.x * b.y - a.y * b.x);
            if (object_area > 0.0f)
                footprint_uv = footprint_object * std::sqrt(uv_area / object_area);
        }
        texel = sampleTexture(textures[use.texture], interpolate(*layer, t, u, v), footprint_uv);
        return true;
    }

    // Tangent and bitangent for a unit normal: the mesh's, or the directions in which the layer's u
    // and v (which points down in the picture) grow. False where neither is known.
    bool tangents(const Vec3& normal, int layer_index, Vec3& tangent, Vec3& bitangent) const {
        float side = 0.0f;
        if (!mesh.tangents.empty()) {
            const Vec4 stored = interpolate(mesh.tangents, t, u, v);
            tangent = Vec3(stored);
            side = stored.w < 0.0f ? -1.0f : 1.0f;
        }
        if (side == 0.0f || !(glm::dot(tangent, tangent) > 1e-12f)) {
            const std::vector<Vec2>* layer = uvs(layer_index);
            if (!layer) return false;
            const Vec3 e1 = mesh.positions[t.y] - mesh.positions[t.x],
                       e2 = mesh.positions[t.z] - mesh.positions[t.x];
            const Vec2 a = (*layer)[t.y] - (*layer)[t.x], b = (*layer)[t.z] - (*layer)[t.x];
            const float determinant = a.x * b.y - a.y * b.x;
            if (!(std::abs(determinant) > 0.0f)) return false;
            tangent = safeNormalize((e1 * b.y - e2 * a.y) * (determinant < 0.0f ? -1.0f : 1.0f));
            // The map's y points up in the picture, v down.
            side = determinant > 0.0f ? -1.0f : 1.0f;
        }
        tangent = tangent - normal * glm::dot(normal, tangent);
        if (!(glm::dot(tangent, tangent) > 1e-12f)) return false;
        tangent = safeNormalize(tangent);
        bitangent = glm::cross(normal, tangent) * side;
        return true;
    }
};

// Base colour and alpha: material x texture x vertex colour.
Vec4 baseColor(const Place& place, const Material& material) {
    Vec4 color(material.base_color, material.alpha), texel;
    if (!place.mesh.colors.empty())
        color *= interpolate(place.mesh.colors, place.t, place.u, place.v);
    if (place.lookUp({material.base_texture, 0}, texel)) color *= texel;
    return color;
}

// The normal turned by the material's normal map.
Vec3 mappedNormal(const Place& place, const Material& material, const Vec3& normal) {
    Vec4 texel;
    Vec3 tangent, bitangent;
    if (!place.lookUp(material.normal_map, texel) ||
        !place.tangents(normal, material.normal_map.uv_layer, tangent, bitangent)) {
        return normal;
    }
    const Vec3 n = Vec3(texel) * 2.0f - 1.0f;
    return safeNormalize(tangent * (n.x * material.normal_scale) +
                         bitangent * (n.y * material.normal_scale) + normal * std::max(n.z, 1e-3f));
}

}  // namespace

MeshSurface surfaceAt(const Mesh& mesh, const std::vector<Material>& materials,
                      const std::vector<Texture>& textures, uint32_t triangle, float u, float v,
                      float footprint_object) {
    const Place place{mesh, textures, mesh.triangles[triangle], u, v, footprint_object};
    const Material& material = materials[mesh.triangle_material[triangle]];
    const UVec3& t = place.t;
    MeshSurface s;
    if (!mesh.normals.empty()) s.normal_object = interpolate(mesh.normals, t, u, v);
    if (!(glm::dot(s.normal_object, s.normal_object) > 1e-12f)) {
        s.normal_object = glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                                     mesh.positions[t.z] - mesh.positions[t.x]);
    }
    s.normal_object = mappedNormal(place, material, safeNormalize(s.normal_object));
    const Vec4 color = baseColor(place, material);
    s.albedo = Vec3(color);
    s.alpha = color.w;
    if (Vec4 texel; place.lookUp(material.metallic_map, texel))
        s.albedo *= 1.0f - material.metallic * texel.b;
    return s;
}

float alphaAt(const Mesh& mesh, const std::vector<Material>& materials,
              const std::vector<Texture>& textures, uint32_t triangle, float u, float v) {
    return baseColor({mesh, textures, mesh.triangles[triangle], u, v, 0.0f},
                     materials[mesh.triangle_material[triangle]])
        .w;
}

}  // namespace stipple
