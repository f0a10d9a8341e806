// SPDX-License-Identifier: Apache-2.0
#include <raster/mesh_arrays.h>

namespace stipple {

namespace {

constexpr uint32_t kNone = 0xffffffffu;

template <class T>
bool isEmpty(const std::vector<T>* values) {
    return !values || values->empty();
}

SurfaceState surfaceState(const RasterMesh& mesh, uint32_t index,
                          const std::vector<Material>& materials,
                          const std::vector<AlphaRange>& texture_alpha, AlphaRange vertex_alpha) {
    const Material& material = materials[index];
    SurfaceState state;
    state.double_sided = material.double_sided;
    if (material.alpha_mode == AlphaMode::kOpaque) return state;
    AlphaRange alpha{material.alpha * vertex_alpha.min, material.alpha * vertex_alpha.max};
    if (material.base_texture != kNoTexture && !isEmpty(mesh.uvs)) {
        alpha.min *= texture_alpha[material.base_texture].min;
        alpha.max *= texture_alpha[material.base_texture].max;
    }
    state.hidden = alpha.max < alphaCutoff(material);
    if (alpha.min < alphaCutoff(material)) state.masked_material = int(index);
    return state;
}

std::vector<MeshRun> makeRuns(const RasterMesh& mesh, const std::vector<Material>& materials,
                              const std::vector<AlphaRange>& texture_alpha) {
    AlphaRange vertex_alpha;
    if (!isEmpty(mesh.colors)) {
        vertex_alpha = {kInfinity, -kInfinity};
        for (const Vec4& c : *mesh.colors) {
            vertex_alpha = {std::min(vertex_alpha.min, c.w), std::max(vertex_alpha.max, c.w)};
        }
    }
    std::vector<MeshRun> runs;
    const std::vector<uint16_t>& indices = *mesh.triangle_material;
    SurfaceState state;
    for (uint32_t t = 0; t < indices.size(); ++t) {
        if (t == 0 || indices[t] != indices[t - 1]) {
            state = surfaceState(mesh, indices[t], materials, texture_alpha, vertex_alpha);
        }
        if (t == 0 || !(runs.back().state == state)) runs.push_back({t, 0, state});
        ++runs.back().count;
    }
    return runs;
}

// Which of its corners each triangle gets for itself: one that no earlier triangle has, or else the
// first. owner[v]: the first triangle that took v.
void takeCorners(const std::vector<UVec3>& triangles, std::vector<uint8_t>& own_corner,
                 std::vector<uint32_t>& owner) {
    for (uint32_t t = 0; t < triangles.size(); ++t) {
        for (uint8_t k = 0; k < 3; ++k) {
            uint32_t& o = owner[triangles[t][k]];
            if (o != kNone) continue;
            o = t;
            own_corner[t] = k;
            break;
        }
    }
}

}  // namespace

float alphaCutoff(const Material& material) {
    return material.alpha_mode == AlphaMode::kMask ? material.alpha_cutoff : 0.5f;
}

AlphaRange alphaRange(const Texture& texture) {
    if (texture.levels.empty() || texture.levels[0].rgba.empty()) return {};
    const std::vector<uint8_t>& rgba = texture.levels[0].rgba;
    uint8_t low = 255, high = 0;
    for (size_t i = 3; i < rgba.size(); i += 4)
        low = std::min(low, rgba[i]), high = std::max(high, rgba[i]);
    return {float(low) / 255.0f, float(high) / 255.0f};
}

MeshArrays makeMeshArrays(const RasterMesh& mesh, const std::vector<Material>& materials,
                          const std::vector<AlphaRange>& texture_alpha) {
    const std::vector<UVec3>& triangles = *mesh.triangles;
    const size_t n_triangles = triangles.size(), n_vertices = mesh.positions->size();
    MeshArrays arrays;
    arrays.runs = makeRuns(mesh, materials, texture_alpha);

    std::vector<uint8_t> own_corner(n_triangles, 0);
    std::vector<uint32_t> copy(n_vertices, kNone);  // the copy of each vertex that is used now
    takeCorners(triangles, own_corner, copy);
    std::vector<uint32_t> source(n_triangles);  // the mesh's vertex of each of ours
    arrays.triangles.resize(n_triangles);
    for (uint32_t t = 0; t < n_triangles; ++t) {
        const UVec3 corners = triangles[t];
        const uint8_t own = own_corner[t];
        source[t] = corners[own];
        copy[corners[own]] = t;  // the newest: triangles that follow find it in the cache
        const auto find = [&](uint32_t v) {
            if (copy[v] == kNone) {
                copy[v] = uint32_t(source.size());
                source.push_back(v);
            }
            return copy[v];
        };
        const uint32_t first = find(corners[(own + 1) % 3]), second = find(corners[(own + 2) % 3]);
        arrays.triangles[t] = UVec3(first, second, t);
    }

    arrays.positions.reserve(source.size());
    for (const uint32_t v : source) {
        arrays.positions.push_back((*mesh.positions)[v]);
        arrays.bounds.extend(arrays.positions.back());
    }
    const bool masked = std::any_of(arrays.runs.begin(), arrays.runs.end(), [](const MeshRun& run) {
        return run.state.masked_material >= 0 && !run.state.hidden;
    });
    if (masked) {
        arrays.masks.reserve(source.size());
        for (const uint32_t v : source) {
            arrays.masks.emplace_back(isEmpty(mesh.uvs) ? Vec2(0.0f) : (*mesh.uvs)[v],
                                      isEmpty(mesh.colors) ? 1.0f : (*mesh.colors)[v].w);
        }
    }
    return arrays;
}

}  // namespace stipple
