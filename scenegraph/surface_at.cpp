// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/surface_at.h>

namespace stipple {

namespace {

template <class T>
T interpolate(const std::vector<T>& values, const UVec3& t, float u, float v) {
    return values[t.x] * (1.0f - u - v) + values[t.y] * u + values[t.z] * v;
}

// Base colour and alpha: material x texture x vertex colour.
Vec4 baseColor(const Mesh& mesh, const Material& material, const std::vector<Texture>& textures,
               const UVec3& t, float u, float v, float footprint_object) {
    Vec4 color(material.base_color, material.alpha);
    if (!mesh.colors.empty()) color *= interpolate(mesh.colors, t, u, v);
    if (material.base_texture != kNoTexture && !mesh.uvs.empty()) {
        float footprint_uv = 0.0f;
        if (footprint_object > 0.0f) {
            // Object space to uv by the ratio of the triangle's areas.
            const Vec3 e1 = mesh.positions[t.y] - mesh.positions[t.x],
                       e2 = mesh.positions[t.z] - mesh.positions[t.x];
            const Vec2 a = mesh.uvs[t.y] - mesh.uvs[t.x], b = mesh.uvs[t.z] - mesh.uvs[t.x];
            const float object_area = glm::length(glm::cross(e1, e2)),
                        uv_area = std::abs(a.x * b.y - a.y * b.x);
            if (object_area > 0.0f)
                footprint_uv = footprint_object * std::sqrt(uv_area / object_area);
        }
        color *= sampleTexture(textures[material.base_texture], interpolate(mesh.uvs, t, u, v),
                               footprint_uv);
    }
    return color;
}

}  // namespace

MeshSurface surfaceAt(const Mesh& mesh, const std::vector<Material>& materials,
                      const std::vector<Texture>& textures, uint32_t triangle, float u, float v,
                      float footprint_object) {
    const UVec3& t = mesh.triangles[triangle];
    MeshSurface s;
    if (!mesh.normals.empty()) s.normal_object = interpolate(mesh.normals, t, u, v);
    if (!(glm::dot(s.normal_object, s.normal_object) > 1e-12f)) {
        s.normal_object = glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                                     mesh.positions[t.z] - mesh.positions[t.x]);
    }
    // Scaled before normalizing: edge products of small triangles underflow in float.
    const float largest = std::max(
        {std::abs(s.normal_object.x), std::abs(s.normal_object.y), std::abs(s.normal_object.z)});
    if (largest > 0.0f) s.normal_object = glm::normalize(s.normal_object / largest);
    const Vec4 color = baseColor(mesh, materials[mesh.triangle_material[triangle]], textures, t, u,
                                 v, footprint_object);
    s.albedo = Vec3(color);
    s.alpha = color.w;
    return s;
}

float alphaAt(const Mesh& mesh, const std::vector<Material>& materials,
              const std::vector<Texture>& textures, uint32_t triangle, float u, float v) {
    const Material& material = materials[mesh.triangle_material[triangle]];
    return baseColor(mesh, material, textures, mesh.triangles[triangle], u, v, 0.0f).w;
}

}  // namespace stipple
