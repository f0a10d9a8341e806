// SPDX-License-Identifier: Apache-2.0
// Points drawn on grids are spread over u and v as the Jacobian determinant of the displaced
// surface says: chi-square, on every surface.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <sampling/list_point.h>

#include "../unit/uv_grid_samples.h"
#include "chi_square.h"

namespace stipple {
namespace {

constexpr int kBins = 12;  // along u and v

// Area over each bin, from the surface itself.
std::vector<double> binAreas(const DisplacedSurface& surface) {
    constexpr int kSteps = 40;
    constexpr double kStep = 1.0 / (kBins * kSteps);
    std::vector<double> areas(kBins * kBins, 0.0);
    for (int j = 0; j < kBins * kSteps; ++j) {
        for (int i = 0; i < kBins * kSteps; ++i) {
            const double u = i * kStep, v = j * kStep;
            const DVec3 across = surface.position(u + kStep, v + kStep) - surface.position(u, v),
                        other = surface.position(u + kStep, v) - surface.position(u, v + kStep);
            areas[size_t(j / kSteps * kBins + i / kSteps)] +=
                0.5 * glm::length(glm::cross(across, other));
        }
    }
    return areas;
}

class UvGridDensity : public testing::TestWithParam<std::string> {};

TEST_P(UvGridDensity, followsTheJacobian) {
    UvGridParams params;
    params.shape = shapeOf(GetParam());
    params.displacements.push_back(ripples(0.06, 4, 3, 24));
    ThreadPool pool(2);
    UvGrid grid = makeUvGrid(params, pool);
    Mesh& mesh = grid.mesh;
    buildMesh(mesh, {Material()}, "test");
    const DisplacedSurface surface(params, DVec2(0.0));
    const std::vector<double> areas = binAreas(surface);
    double whole = 0.0;
    for (const double area : areas) whole += area;
    EXPECT_NEAR(mesh.area / whole, 1.0, 0.005);

    constexpr uint32_t kPoints = 40000;
    std::vector<double> counts(areas.size(), 0.0), expected;
    for (const double area : areas) expected.push_back(kPoints * area / whole);
    for (uint32_t index = 0; index < kPoints; ++index) {
        const PointKey key{Sampler::kRandom, hashCombine(uint64_t(7), uint64_t(3)), index};
        const MeshPoint p =
            meshPointAt(mesh.cumulative_area, mesh.nodes[0], listPosition(key), key);
        const UVec3& t = mesh.triangles[p.triangle];
        const Vec2 uv =
            mesh.uvs[t.x] * (1.0f - p.u - p.v) + mesh.uvs[t.y] * p.u + mesh.uvs[t.z] * p.v;
        const auto bin = [](double x) {
            return std::clamp(int((x - std::floor(x)) * kBins), 0, kBins - 1);
        };
        counts[size_t(bin(1.0 - double(uv.y)) * kBins + bin(double(uv.x)))] += 1.0;
    }
    EXPECT_LT(chiSquare(counts, expected), criticalValue(double(areas.size() - 1)));
}

std::vector<std::string> surfaceNames() {
    std::vector<std::string> names;
    for (const GridSurfaceInfo& info : gridSurfaces()) names.push_back(info.name);
    return names;
}
INSTANTIATE_TEST_SUITE_P(surfaces, UvGridDensity, testing::ValuesIn(surfaceNames()),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace stipple
