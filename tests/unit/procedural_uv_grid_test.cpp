// SPDX-License-Identifier: Apache-2.0
// Grids: surfaces, tables, the mesh between, where it is stretched, refined and closed.
#include <core/error.h>
#include <gtest/gtest.h>
#include <scenegraph/surface_at.h>

#include <array>
#include <map>

#include "uv_grid_samples.h"

namespace stipple {
namespace {

UvGrid gridOf(const UvGridParams& params) {
    ThreadPool pool(2);
    return makeUvGrid(params, pool);
}

UvGridParams rippled(const std::string& surface, double amplitude = 0.05) {
    UvGridParams params;
    params.shape = shapeOf(surface);
    params.displacements.push_back(ripples(amplitude, 8, 4));
    return params;
}

TEST(UvGridSurface, tangentsAndNormalsAreThoseOfDifferences) {
    for (const GridSurfaceInfo& info : gridSurfaces()) {
        const GridShape shape = shapeOf(info.name);
        for (const double u : {0.1, 0.37, 0.81}) {
            for (const double v : {0.15, 0.5, 0.77}) {
                constexpr double kStep = 1e-5;
                const auto p = [&](double du, double dv) {
                    return info.at(shape, u + du * kStep, v + dv * kStep).position;
                };
                const DVec3 along_u = glm::normalize(p(1, 0) - p(-1, 0));
                const GridPlace place = info.at(shape, u, v);
                EXPECT_LT(glm::distance(place.tangent, along_u), 1e-6) << info.name;
                const DVec3 normal = glm::normalize(glm::cross(along_u, p(0, 1) - p(0, -1)));
                EXPECT_LT(glm::distance(place.normal, normal), 1e-6) << info.name;
            }
        }
        const auto isSame = [&](double u0, double v0, double u1, double v1) {
            return glm::distance(info.at(shape, u0, v0).position, info.at(shape, u1, v1).position) <
                   1e-9;
        };
        EXPECT_TRUE(!info.is_closed_u || isSame(0.0, 0.3, 1.0, 0.3)) << info.name;
        EXPECT_TRUE(!info.is_closed_v || isSame(0.3, 0.0, 0.3, 1.0)) << info.name;
    }
}

TEST(UvGridTable, saysWhatItsTexelsSayAndCoarselyTheirMean) {
    const GridTable table = tableOf(7, 5, [](double x, double y) { return 3.0 * x - y * y; });
    double mean = 0.0;
    for (int y = 0; y < 5; ++y) {
        for (int x = 0; x < 7; ++x) {
            const DVec2 place((x + 0.5) / 7, (y + 0.5) / 5);
            EXPECT_NEAR(table.at(place, DVec2(0.0), false, false).x,
                        3.0 * place.x - place.y * place.y, 1e-6);
            mean += (3.0 * place.x - place.y * place.y) / 35.0;
        }
    }
    EXPECT_NEAR(table.at(DVec2(0.2, 0.9), DVec2(10.0), false, false).x, mean, 1e-6);
    // Cubic: exact for lines between texels, and no step in the slope at a texel.
    EXPECT_NEAR(table.at(DVec2(0.5 + 0.3 / 7, 0.5), DVec2(0.0), false, false).x,
                3.0 * (0.5 + 0.3 / 7) - 0.25, 1e-5);
}

// Every vertex of a grid with the table's own number of cells lies on a texel.
TEST(UvGrid, showsEveryTexel) {
    UvGridParams params;
    params.displacements.emplace_back().table =
        tableOf(6, 4, [](double x, double y) { return std::sin(40.0 * x + 17.0 * y); });
    const UvGrid grid = gridOf(params);
    EXPECT_EQ(grid.cells_u, 6);
    EXPECT_EQ(grid.cells_v, 4);
    size_t n_on_texels = 0;
    for (const Vec3& p : grid.mesh.positions) {
        const double x = double(p.x) + 0.5, y = double(p.z) + 0.5;
        const bool is_border = std::min({x, y, 1.0 - x, 1.0 - y}) < 1e-6;
        if (is_border) continue;
        ++n_on_texels;
        EXPECT_NEAR(double(p.y), std::sin(40.0 * x + 17.0 * y), 1e-5);
    }
    EXPECT_EQ(n_on_texels, 24u);
}

TEST(UvGrid, coarserThanItsTableItShowsTheMean) {
    UvGridParams params;
    params.displacements.emplace_back().table =
        tableOf(64, 64, [](double x, double) { return int(x * 64) % 2 == 0 ? 1.0 : 0.0; });
    params.cells_u = params.cells_v = 8;
    for (const Vec3& p : gridOf(params).mesh.positions) EXPECT_NEAR(p.y, 0.5f, 1e-3f);
}

TEST(UvGrid, vectorsGoAlongTheSurfaceOrTheObject) {
    UvGridParams params;
    params.shape = shapeOf("cylinder");
    GridDisplacement& d = params.displacements.emplace_back();
    d.table = makeGridTable(1, 1, {Vec3(0.0f, 0.25f, 0.5f)});
    d.along = GridDisplacement::Along::kSurface;  // 0.25 up and 0.5 out
    Box3 box;
    for (const Vec3& p : gridOf(params).mesh.positions) box.extend(p);
    EXPECT_NEAR(box.max.y, 0.75f, 1e-5f);
    EXPECT_NEAR(box.max.x, 1.0f, 1e-3f);
    d.along = GridDisplacement::Along::kObject;
    box = Box3();
    for (const Vec3& p : gridOf(params).mesh.positions) box.extend(p);
    EXPECT_NEAR(box.max.y, 0.75f, 1e-5f);
    EXPECT_NEAR(box.max.z, 1.0f, 1e-3f);
    EXPECT_NEAR(box.min.z, 0.0f, 1e-3f);
}

TEST(UvGrid, normalsAreThoseOfTheDisplacedSurface) {
    UvGridParams params;  // y = 0.1 sin(6 x)
    params.displacements.emplace_back().table =
        tableOf(256, 2, [](double x, double) { return 0.1 * std::sin(6.0 * (x - 0.5)); });
    const UvGrid grid = gridOf(params);
    for (size_t i = 0; i < grid.mesh.positions.size(); ++i) {
        const double x = double(grid.mesh.positions[i].x);
        if (std::abs(x) > 0.49) continue;
        const Vec3 expected(glm::normalize(DVec3(-0.6 * std::cos(6.0 * x), 1.0, 0.0)));
        EXPECT_GT(glm::dot(grid.mesh.normals[i], expected), 0.9999f) << x;
    }
}

// A coarse grid is lit as a fine one is.
TEST(UvGrid, detailBeyondItsCellsIsInItsNormalMap) {
    for (const char* surface : {"plane", "torus", "sphere"}) {
        UvGridParams params = rippled(surface, 0.01);
        params.cells_u = params.cells_v = 40;
        ThreadPool pool(2);
        UvGrid grid = makeUvGrid(params, pool);
        ASSERT_TRUE(grid.isCoarserThanTables());
        EXPECT_EQ(detailSize(grid), glm::ivec2(96, 48));
        const std::vector<Texture> textures = {makeDetailNormals(params, grid, pool)};
        std::vector<Material> plain(1), mapped(1);
        mapped[0].normal_map = {0, 1};
        const DisplacedSurface exact(params, DVec2(1.0 / 96, 1.0 / 48));
        double error = 0.0, plain_error = 0.0;
        for (uint32_t t = 0; t < grid.mesh.triangles.size(); ++t) {
            const auto& layer = grid.mesh.more_uvs[0];
            const UVec3& corners = grid.mesh.triangles[t];
            const DVec2 uv((layer[corners.x] + layer[corners.y] + layer[corners.z]) / 3.0f);
            if (uv.y < 0.1 || uv.y > 0.9) continue;
            DVec3 tangent;
            const Vec3 expected(exact.normal(uv.x, 1.0 - uv.y, tangent));
            const auto at = [&](const std::vector<Material>& materials) {
                return surfaceAt(grid.mesh, materials, textures, t, 1 / 3.0f, 1 / 3.0f, {})
                    .normal_object;
            };
            error += double(glm::distance(at(mapped), expected));
            plain_error += double(glm::distance(at(plain), expected));
        }
        EXPECT_LT(error, 0.2 * plain_error) << surface;
        params.cells_u = 96, params.cells_v = 48;
        EXPECT_FALSE(makeUvGrid(params, pool).isCoarserThanTables());
    }
}

// How often the edges of the mesh, by positions, belong to one triangle only, or to more than two.
size_t openEdges(const Mesh& mesh) {
    std::map<std::array<float, 3>, uint32_t> ids;
    const auto id = [&](uint32_t v) {
        const Vec3& p = mesh.positions[v];
        return ids.try_emplace({p.x, p.y, p.z}, uint32_t(ids.size())).first->second;
    };
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (const UVec3& t : mesh.triangles) {
        const uint32_t v[3] = {id(t.x), id(t.y), id(t.z)};
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;  // at a pole
        for (int k = 0; k < 3; ++k) ++edges[std::minmax(v[k], v[(k + 1) % 3])];
    }
    size_t open = 0;
    for (const auto& [edge, count] : edges) open += count != 2;
    return open;
}

TEST(UvGrid, bodiesAreClosedWhereverTheyAreRefined) {
    for (const char* surface : {"sphere", "torus"}) {
        for (const int refine : {0, 1, 3}) {
            UvGridParams params = rippled(surface, 0.15);
            params.cells_u = 48, params.cells_v = 24;
            params.refine = refine;
            const UvGrid grid = gridOf(params);
            EXPECT_EQ(openEdges(grid.mesh), 0u) << surface << ", refined " << refine;
            EXPECT_EQ(grid.mesh.triangles.size() > 2u * 48u * 25u, refine > 0);
        }
    }
}

TEST(UvGrid, tellsWhereItPullsApartAndRefinementHeals) {
    UvGridParams params;  // a cliff
    params.displacements.emplace_back().table =
        tableOf(32, 32, [](double x, double) { return x < 0.7 ? 0.0 : 0.5; });
    const UvGrid coarse = gridOf(params);
    EXPECT_GT(coarse.stretch.most, 10.0);
    EXPECT_NEAR(coarse.stretch.u, 0.7, 0.05);
    EXPECT_GT(coarse.stretch.share, 0.01);
    params.refine = 4;
    const UvGrid fine = gridOf(params);
    EXPECT_LT(fine.stretch.most, kMostStretch);
    EXPECT_EQ(fine.stretch.share, 0.0);
    // Only the cliff is finer.
    EXPECT_LT(fine.mesh.triangles.size(), 256u * coarse.mesh.triangles.size() / 4u);
    EXPECT_LT(gridOf(rippled("sphere", 0.0)).stretch.most, 1.1);
}

TEST(UvGrid, isTheSameForAnyNumberOfThreads) {
    UvGridParams params = rippled("torus", 0.1);
    params.refine = 2;
    params.has_normal_map = true;
    ThreadPool one(1), seven(7);
    const Mesh a = makeUvGrid(params, one).mesh, b = makeUvGrid(params, seven).mesh;
    EXPECT_EQ(a.positions, b.positions);
    EXPECT_EQ(a.normals, b.normals);
    EXPECT_EQ(a.tangents, b.tangents);
    EXPECT_EQ(a.triangles, b.triangles);
}

TEST(UvGrid, refusesWhatIsTooLargeOrDoesNotFit) {
    UvGridParams params;
    params.cells_u = params.cells_v = 16384;
    EXPECT_THROW(gridOf(params), Error);
    params = rippled("sphere");
    params.displacements[0].repeat = DVec2(1.5, 1.0);
    EXPECT_THROW(gridOf(params), Error);
    params.shape.surface = "spheer";
    EXPECT_THROW(gridOf(params), Error);
    params = rippled("sphere");
    params.reserve = [](double) { throw Error(ErrorCode::kOutOfMemory, "", "none left"); };
    EXPECT_THROW(gridOf(params), Error);
}

}  // namespace
}  // namespace stipple
