// SPDX-License-Identifier: Apache-2.0
// The share of pixels of a solid surface that no point hits, against k points a pixel, before
// anything is filled: random points (exp(-k)) beside the prefixes of the point lists that pictures
// are drawn with. Prints a table of docs/performance.md.
#include <sampling/list_point.h>
#include <scenegraph/procedural/generators.h>

#include <cmath>
#include <cstdio>

namespace stipple {
namespace {

constexpr int kSide = 256;  // pixels along a side of a square plane seen face on
constexpr int kLists = 8;   // averaged over so many lists

// A plane whose triangles have about this area in pixels.
Mesh plane(double triangle_area) {
    GeneratedMesh made =
        makePrimitive("plane", int(std::lround(kSide * kSide / triangle_area)), Vec3(0.5f));
    buildMesh(made.mesh, made.materials, "plane");
    return std::move(made.mesh);
}

double emptyShare(const Mesh& mesh, Sampler sampler, int k) {
    size_t empty = 0;
    for (uint64_t list = 1; list <= kLists; ++list) {
        std::vector<uint8_t> hit(kSide * kSide, 0);
        for (uint32_t i = 0; i < uint32_t(k * kSide * kSide); ++i) {
            const PointKey key{sampler, list, i};
            const MeshPoint p =
                meshPointAt(mesh.cumulative_area, mesh.nodes[0], listPosition(key), key);
            const UVec3& t = mesh.triangles[p.triangle];
            const Vec3 q = mesh.positions[t.x] * (1 - p.u - p.v) + mesh.positions[t.y] * p.u +
                           mesh.positions[t.z] * p.v;
            const auto pixel = [](float v) {
                return size_t(std::clamp(int((v + 0.5f) * kSide), 0, kSide - 1));
            };
            hit[pixel(q.z) * kSide + pixel(q.x)] = 1;
        }
        for (const uint8_t h : hit) empty += h == 0;
    }
    return double(empty) / double(kLists * kSide * kSide);
}

void printTable() {
    const double areas[] = {0.3, 3.0, 20.0};
    std::printf("| k | exp(-k) | random |");
    for (const double area : areas) std::printf(" triangles of %g pixels |", area);
    std::printf("\n|---|---|---|---|---|---|\n");
    const Mesh meshes[] = {plane(areas[0]), plane(areas[1]), plane(areas[2])};
    for (const int k : {1, 2, 3, 4, 6, 8}) {
        std::printf("| %d | %.5f | %.5f |", k, std::exp(-double(k)),
                    emptyShare(meshes[1], Sampler::kRandom, k));
        for (const Mesh& mesh : meshes)
            std::printf(" %.5f |", emptyShare(mesh, Sampler::kStratified, k));
        std::printf("\n");
        std::fflush(stdout);
    }
}

}  // namespace
}  // namespace stipple

int main() { stipple::printTable(); }
