// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <scenegraph/procedural/generators.h>

namespace stipple {

namespace {

// A grid of (columns + 1) x (rows + 1) vertices, or fewer where it closes on itself; `place` gives
// position and normal for (column, row), in counter-clockwise order seen from outside.
template <class Place>
void appendGrid(Mesh& mesh, int columns, int rows, bool wrap_columns, bool wrap_rows,
                const Place& place) {
    const uint32_t first = uint32_t(mesh.positions.size());
    const int column_count = wrap_columns ? columns : columns + 1,
              row_count = wrap_rows ? rows : rows + 1;
    for (int j = 0; j < row_count; ++j) {
        for (int i = 0; i < column_count; ++i) {
            Vec3 p, n;
            place(i, j, p, n);
            mesh.positions.push_back(p);
            mesh.normals.push_back(n);
        }
    }
    const auto index = [&](int i, int j) {
        return first + uint32_t(j % row_count) * uint32_t(column_count) +
               uint32_t(i % column_count);
    };
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            const uint32_t a = index(i, j), b = index(i + 1, j), c = index(i + 1, j + 1),
                           d = index(i, j + 1);
            mesh.triangles.push_back(UVec3(a, b, c));
            mesh.triangles.push_back(UVec3(a, c, d));
        }
    }
}

void appendFace(Mesh& mesh, int cells, const Vec3& center, const Vec3& u, const Vec3& v) {
    const Vec3 normal = glm::normalize(glm::cross(u, v));
    appendGrid(mesh, cells, cells, false, false, [&](int i, int j, Vec3& p, Vec3& n) {
        p = center + u * (float(i) / float(cells) - 0.5f) + v * (float(j) / float(cells) - 0.5f);
        n = normal;
    });
}

int cellsFor(double triangles, double triangles_per_cell_squared, int least) {
    return std::max(least, int(std::lround(std::sqrt(triangles / triangles_per_cell_squared))));
}

void appendSphere(Mesh& mesh, int triangles) {
    // `rows` bands of 2 x rows quads; those at the poles are triangles: 4 rows (rows - 1) in all.
    const int rows = std::max(2, int(std::lround(0.5 + 0.5 * std::sqrt(1.0 + triangles)))),
              columns = 2 * rows;
    const auto onSphere = [&](int i, int j) {
        const double theta = kPi * j / rows, phi = 2.0 * kPi * i / columns;
        return Vec3(DVec3(std::sin(theta) * std::sin(phi), -std::cos(theta),
                          std::sin(theta) * std::cos(phi)));
    };
    appendGrid(mesh, columns, rows - 2, true, false, [&](int i, int j, Vec3& p, Vec3& n) {
        n = onSphere(i, j + 1);
        p = 0.5f * n;
    });
    const uint32_t last_ring = uint32_t(rows - 2) * uint32_t(columns),
                   south = uint32_t(mesh.positions.size());
    for (const float y : {-1.0f, 1.0f}) {
        mesh.positions.push_back(Vec3(0.0f, 0.5f * y, 0.0f));
        mesh.normals.push_back(Vec3(0.0f, y, 0.0f));
    }
    for (uint32_t i = 0; i < uint32_t(columns); ++i) {
        const uint32_t next = (i + 1) % uint32_t(columns);
        mesh.triangles.push_back(UVec3(south, next, i));
        mesh.triangles.push_back(UVec3(south + 1, last_ring + i, last_ring + next));
    }
}

void appendTorus(Mesh& mesh, int triangles) {
    constexpr double kRing = 0.35, kTube = 0.15;  // radii: outer diameter 1
    const int around_tube = cellsFor(triangles, 4.0, 3), around_ring = 2 * around_tube;
    appendGrid(mesh, around_ring, around_tube, true, true, [&](int i, int j, Vec3& p, Vec3& n) {
        const double phi = 2.0 * kPi * i / around_ring, theta = 2.0 * kPi * j / around_tube;
        const DVec3 out(std::sin(phi), 0.0, std::cos(phi));
        const DVec3 normal = out * std::cos(theta) + DVec3(0.0, std::sin(theta), 0.0);
        p = Vec3(out * kRing + normal * kTube);
        n = Vec3(normal);
    });
}

}  // namespace

GeneratedMesh makePrimitive(const std::string& kind, int triangles, const Vec3& color,
                            float alpha) {
    if (triangles < 1 || triangles > 50000000) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a primitive's triangles must be in 1..50000000");
    }
    GeneratedMesh result;
    Mesh& mesh = result.mesh;
    mesh.name = kind;
    const Vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
    if (kind == "sphere") {
        appendSphere(mesh, triangles);
    } else if (kind == "box") {
        const int cells = cellsFor(triangles, 12.0, 1);
        appendFace(mesh, cells, 0.5f * x, y, z);
        appendFace(mesh, cells, -0.5f * x, z, y);
        appendFace(mesh, cells, 0.5f * y, z, x);
        appendFace(mesh, cells, -0.5f * y, x, z);
        appendFace(mesh, cells, 0.5f * z, x, y);
        appendFace(mesh, cells, -0.5f * z, y, x);
    } else if (kind == "plane") {
        appendFace(mesh, cellsFor(triangles, 2.0, 1), Vec3(0.0f), z, x);
    } else if (kind == "torus") {
        appendTorus(mesh, triangles);
    } else {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "unknown primitive '" + kind + "' (sphere, box, plane or torus)");
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    Material material;
    material.name = kind;
    material.base_color = color;
    if (alpha < 1.0f) {
        material.alpha = alpha;
        material.alpha_mode = AlphaMode::kBlend;
        material.double_sided = true;
    }
    result.materials.push_back(material);
    return result;
}

}  // namespace stipple
