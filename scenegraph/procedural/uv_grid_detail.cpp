// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/uv_grid.h>

namespace stipple {

namespace {

constexpr uint32_t kNone = UINT32_MAX;

double cross2(DVec2 a, DVec2 b) { return a.x * b.y - a.y * b.x; }

// A triangle in texels of the map, and where in it a place lies.
struct FlatTriangle {
    DVec2 a, e1, e2;
    FlatTriangle(const std::vector<Vec2>& uvs, const UVec3& t, DVec2 size)
        : a(DVec2(uvs[t.x]) * size),
          e1(DVec2(uvs[t.y]) * size - a),
          e2(DVec2(uvs[t.z]) * size - a) {}
    DVec3 barycentrics(DVec2 p) const {
        const double whole = cross2(e1, e2);
        const double u = cross2(p - a, e2) / whole, v = cross2(e1, p - a) / whole;
        return DVec3(1.0 - u - v, u, v);
    }
};

// The triangle over each texel's centre; around a closed side texels come again.
std::vector<uint32_t> trianglesOfTexels(const Mesh& mesh, glm::ivec2 size) {
    std::vector<uint32_t> result(size_t(size.x) * size_t(size.y), kNone);
    for (size_t k = 0; k < mesh.triangles.size(); ++k) {
        const FlatTriangle flat(mesh.more_uvs[0], mesh.triangles[k], DVec2(size));
        const DVec2 b = flat.a + flat.e1, c = flat.a + flat.e2;
        const DVec2 low = glm::min(flat.a, glm::min(b, c)), high = glm::max(flat.a, glm::max(b, c));
        for (int y = int(std::floor(low.y)); y <= int(high.y); ++y) {
            for (int x = int(std::floor(low.x)); x <= int(high.x); ++x) {
                const DVec3 share = flat.barycentrics(DVec2(x + 0.5, y + 0.5));
                if (!(std::min({share.x, share.y, share.z}) >= -1e-9)) continue;
                const int column = (x % size.x + size.x) % size.x,
                          row = (y % size.y + size.y) % size.y;
                result[size_t(row) * size_t(size.x) + size_t(column)] = uint32_t(k);
            }
        }
    }
    return result;
}

}  // namespace

glm::ivec2 detailSize(const UvGrid& grid) {
    return glm::clamp(glm::ivec2(grid.table_cells_u, grid.table_cells_v), 1, kMostDetail);
}

Texture makeDetailNormals(const UvGridParams& params, const UvGrid& grid, ThreadPool& pool) {
    const glm::ivec2 size = detailSize(grid);
    const DVec2 texel(1.0 / size.x, 1.0 / size.y);
    const DisplacedSurface surface(params, texel);
    const Mesh& mesh = grid.mesh;
    const std::vector<uint32_t> triangles = trianglesOfTexels(mesh, size);
    Texture map;
    map.name = "detail";
    map.srgb = false;
    if (!surface.info().is_closed_u) map.wrap_u = Wrap::kClamp;
    if (!surface.info().is_closed_v) map.wrap_v = Wrap::kClamp;
    map.levels.push_back({size.x, size.y, std::vector<uint8_t>(triangles.size() * 4)});
    std::vector<uint8_t>& rgba = map.levels[0].rgba;
    const auto localNormal = [&](DVec2 place, uint32_t triangle) {
        if (triangle == kNone) return DVec3(0.0, 0.0, 1.0);
        const UVec3& t = mesh.triangles[triangle];
        const FlatTriangle flat(mesh.more_uvs[0], t, DVec2(1.0));
        DVec3 share = flat.barycentrics(place);
        for (const double turn_u : {0.0, 1.0}) {  // a closed side's last cell goes beyond 1
            for (const double turn_v : {0.0, -1.0}) {
                const DVec3 other = flat.barycentrics(place + DVec2(turn_u, turn_v));
                if (std::min({other.x, other.y, other.z}) > std::min({share.x, share.y, share.z}))
                    share = other;
            }
        }
        // The frame of surfaceAt().
        DVec3 normal(0.0), tangent(0.0), unused;
        for (int k = 0; k < 3; ++k) {
            normal += DVec3(mesh.normals[t[k]]) * share[k];
            tangent += DVec3(mesh.tangents[t[k]]) * share[k];
        }
        normal = glm::normalize(normal);
        tangent = glm::normalize(tangent - normal * glm::dot(normal, tangent));
        const DVec3 seen = surface.normal(place.x, 1.0 - place.y, unused);
        return DVec3(glm::dot(seen, tangent), glm::dot(seen, glm::cross(normal, tangent)),
                     glm::dot(seen, normal));
    };
    pool.forEach(size_t(size.y), [&](size_t row, int) {
        for (size_t column = 0; column < size_t(size.x); ++column) {
            const size_t index = row * size_t(size.x) + column;
            const DVec3 n = localNormal((DVec2(column, row) + 0.5) * texel, triangles[index]);
            for (int c = 0; c < 3; ++c)
                rgba[index * 4 + size_t(c)] = uint8_t(std::clamp(n[c] * 127.5 + 128.0, 0.0, 255.0));
            rgba[index * 4 + 3] = 255;
        }
    });
    buildMipmaps(map);
    return map;
}

}  // namespace stipple
