// SPDX-License-Identifier: Apache-2.0
// Small plants made of thin sheets: leaves, petals, stalks, all of one double-sided material whose
// colour is in the vertices.
#pragma once

#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/stem.h>

namespace stipple {

class SheetMesh {
public:
    // A blade from base to tip (2 triangles), `width` across at its middle, which arches up a
    // little; darker at its base. normal: unit, as it is lit.
    void leaf(const Vec3& base, const Vec3& tip, const Vec3& width, const Vec3& normal,
              const Vec3& color) {
        const Vec3 middle =
            glm::mix(base, tip, 0.42f) + Vec3(0, 0.06f * glm::length(tip - base), 0);
        const uint32_t v = uint32_t(mesh_.positions.size());
        vertex(base, normal, color * 0.7f);
        vertex(middle + width * 0.5f, normal, color);
        vertex(tip, normal, color);
        vertex(middle - width * 0.5f, normal, color * 0.94f);
        mesh_.triangles.push_back(UVec3(v, v + 1, v + 2));
        mesh_.triangles.push_back(UVec3(v, v + 2, v + 3));
    }
    // A stalk: one triangle, `width` across at its base.
    void spike(const Vec3& base, const Vec3& width, const Vec3& tip, const Vec3& normal,
               const Vec3& color) {
        const uint32_t v = uint32_t(mesh_.positions.size());
        vertex(base - width * 0.5f, normal, color);
        vertex(base + width * 0.5f, normal, color);
        vertex(tip, normal, color);
        mesh_.triangles.push_back(UVec3(v, v + 1, v + 2));
    }

    // The mesh, scaled to that height above the ground (0: as it is).
    GeneratedMesh finish(const std::string& name, double height) && {
        float top = 0.0f;
        for (const Vec3& p : mesh_.positions) top = std::max(top, p.y);
        if (height > 0.0)
            for (Vec3& p : mesh_.positions) p *= float(height) / top;
        GeneratedMesh result;
        mesh_.name = name;
        mesh_.triangle_material.assign(mesh_.triangles.size(), 0);
        result.mesh = std::move(mesh_);
        Material material;
        material.name = name;
        material.base_color = Vec3(1.0f);
        material.double_sided = true;
        material.translucency = 0.3f;
        result.materials.push_back(material);
        return result;
    }

private:
    void vertex(const Vec3& p, const Vec3& n, const Vec3& color) {
        mesh_.positions.push_back(p);
        mesh_.normals.push_back(n);
        mesh_.colors.push_back(Vec4(glm::clamp(color, Vec3(0.0f), Vec3(1.0f)), 1.0f));
    }

    Mesh mesh_;
};

}  // namespace stipple
