// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/surface_at.h>

namespace stipple {

namespace {

template <class T>
T interpolate(const std::vector<T>& values, const UVec3& t, float u, float v) {
    return values[t.x] * (1.0f - u - v) + values[t.y] * u + values[t.z] * v;
}

// Scaled before it is normalized where it must be: edge products of small triangles underflow in
// float.
Vec3 safeNormalize(const Vec3& v) {
    const float squared = glm::dot(v, v);
    if (squared > 1e-30f && squared < 1e30f) return v * (1.0f / std::sqrt(squared));
    const float largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return largest > 0.0f ? glm::normalize(v / largest) : v;
}

// Nearer to edge-on a beam's cut is taken for no longer: more than the lookups along it resolve.
constexpr float kMostStretch = 64.0f;

// A place on a mesh, and looking up textures there.
struct Place {
    const Mesh& mesh;
    const std::vector<Texture>& textures;
    UVec3 t;
    float u, v;
    // The sides of a parallelogram of about the beam's cut with the surface, as shares of the
    // triangle's edges from its first vertex; null: none.
    Vec2 side_a = Vec2(0.0f), side_b = Vec2(0.0f);

    // The texture coordinates of a layer, nullptr if the mesh has none.
    const std::vector<Vec2>* uvs(int layer) const {
        const std::vector<Vec2>* result = &mesh.uvs;
        if (layer > 0)
            result = size_t(layer) <= mesh.more_uvs.size() ? &mesh.more_uvs[layer - 1] : nullptr;
        return result && !result->empty() ? result : nullptr;
    }

    void setBeam(const LookupBeam& beam) {
        if (!(beam.diameter > 0.0f)) return;
        const Vec3 e1 = mesh.positions[t.y] - mesh.positions[t.x],
                   e2 = mesh.positions[t.z] - mesh.positions[t.x];
        const Vec3 normal = glm::cross(e1, e2);
        const float area2 = glm::dot(normal, normal);
        if (!(area2 > 0.0f)) return;
        const Vec3 n = safeNormalize(normal);
        // Across the beam it is as wide as the beam; along its shadow it is stretched.
        Vec3 across = glm::cross(n, beam.direction);
        const float squared = glm::dot(beam.direction, beam.direction);
        if (!(glm::dot(across, across) > 1e-8f * squared)) across = e1;
        across = safeNormalize(across) * beam.diameter;
        const float cosine =
            squared > 0.0f ? std::abs(glm::dot(n, beam.direction)) / std::sqrt(squared) : 1.0f;
        const Vec3 along = glm::cross(across, n) / std::max(cosine, 1.0f / kMostStretch);
        const Vec3 first = glm::cross(e2, normal) / area2, second = glm::cross(normal, e1) / area2;
        const auto inEdges = [&](const Vec3& w) {
            return Vec2(glm::dot(w, first), glm::dot(w, second));
        };
        side_a = inEdges(across), side_b = inEdges(along);
    }

    // False where there is no texture. share: of the beam's cut, along both sides, that is
    // averaged.
    bool lookUp(const TextureUse& use, Vec4& texel, float share = 1.0f) const {
        const std::vector<Vec2>* layer = use.texture == kNoTexture ? nullptr : uvs(use.uv_layer);
        if (!layer) return false;
        const Vec2 at = interpolate(*layer, t, u, v);
        const Texture& texture = textures[use.texture];
        if (side_a == Vec2(0.0f)) {
            texel = sampleTexture(texture, at, 0.0f);
            return true;
        }
        const Vec2 a = ((*layer)[t.y] - (*layer)[t.x]) * share,
                   b = ((*layer)[t.z] - (*layer)[t.x]) * share;
        texel =
            sampleTexture(texture, at, a * side_a.x + b * side_a.y, a * side_b.x + b * side_b.y);
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
// What a surface mirrors is far from linear in its normal: of normals no more is averaged than
// keeps them from aliasing where a pixel has several samples.
constexpr float kNormalShare = 0.75f;

Vec3 mappedNormal(const Place& place, const Material& material, const Vec3& normal) {
    Vec4 texel;
    Vec3 tangent, bitangent;
    if (!place.lookUp(material.normal_map, texel, kNormalShare) ||
        !place.tangents(normal, material.normal_map.uv_layer, tangent, bitangent)) {
        return normal;
    }
    const Vec3 n = Vec3(texel) * 2.0f - 1.0f;
    return safeNormalize(tangent * (n.x * material.normal_scale) +
                         bitangent * (n.y * material.normal_scale) + normal * std::max(n.z, 1e-3f));
}

SurfaceFinish finishAt(const Place& place, const Material& material) {
    SurfaceFinish f = plainFinish(material);
    Vec4 texel;
    if (place.lookUp(material.metallic_roughness_map, texel))
        f.roughness *= texel.g, f.metallic *= texel.b;
    if (place.lookUp(material.specular_color_map, texel))
        f.specular = glm::min(material.specular * Vec3(texel), Vec3(1.0f)) * f.specular_edge;
    if (place.lookUp(material.specular_map, texel))
        f.specular *= texel.a, f.specular_edge *= texel.a;
    if (place.lookUp(material.emissive_map, texel)) f.emissive *= Vec3(texel);
    return f;
}

}  // namespace

MeshSurface surfaceAt(const Mesh& mesh, const std::vector<Material>& materials,
                      const std::vector<Texture>& textures, uint32_t triangle, float u, float v,
                      const LookupBeam& beam) {
    Place place{mesh, textures, mesh.triangles[triangle], u, v};
    const Material& material = materials[mesh.triangle_material[triangle]];
    const bool is_textured = material.isTextured();
    if (is_textured) place.setBeam(beam);
    const UVec3& t = place.t;
    MeshSurface s;
    if (!mesh.normals.empty()) s.normal_object = interpolate(mesh.normals, t, u, v);
    if (!(glm::dot(s.normal_object, s.normal_object) > 1e-12f)) {
        s.normal_object = glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                                     mesh.positions[t.z] - mesh.positions[t.x]);
    }
    s.normal_object = safeNormalize(s.normal_object);
    if (is_textured) s.normal_object = mappedNormal(place, material, s.normal_object);
    const Vec4 color = baseColor(place, material);
    s.albedo = Vec3(color);
    s.alpha = color.w;
    s.finish = is_textured ? finishAt(place, material) : plainFinish(material);
    return s;
}

SurfaceFinish plainFinish(const Material& material) {
    SurfaceFinish f;
    f.metallic = material.metallic;
    f.roughness = material.roughness;
    f.specular = glm::min(material.specular, Vec3(1.0f)) * material.specular_weight;
    f.specular_edge = material.specular_weight;
    f.emissive = material.emissive;
    return f;
}

float alphaAt(const Mesh& mesh, const std::vector<Material>& materials,
              const std::vector<Texture>& textures, uint32_t triangle, float u, float v) {
    return baseColor({mesh, textures, mesh.triangles[triangle], u, v},
                     materials[mesh.triangle_material[triangle]])
        .w;
}

}  // namespace stipple
