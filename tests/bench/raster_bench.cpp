// SPDX-License-Identifier: Apache-2.0
// How fast the OSMesa rasterizer is: triangles a second of one dense mesh, of many instances drawn
// whole and of many short ranges; clearing and reading back; starting. Arguments of a benchmark:
// width and height in subpixels.
#include <core/error.h>
#include <raster/rasterizer.h>

#include <benchmark/benchmark.h>

#include <numeric>

namespace stipple {
namespace {

// A wavy square over [-1, 1]^2 of about n triangles, in Morton order as buildMesh makes it.
struct Sheet {
    explicit Sheet(int n) {
        const uint32_t side = uint32_t(std::sqrt(n / 2.0));
        for (uint32_t y = 0; y <= side; ++y) {
            for (uint32_t x = 0; x <= side; ++x) {
                const float u = 2.0f * float(x) / float(side) - 1.0f,
                            v = 2.0f * float(y) / float(side) - 1.0f;
                positions.emplace_back(u, v, 0.05f * std::sin(20.0f * u) * std::cos(17.0f * v));
            }
        }
        const auto even_bits = [](uint32_t i) {
            uint32_t r = 0;
            for (int k = 0; k < 16; ++k) r |= ((i >> (2 * k)) & 1) << k;
            return r;
        };
        for (uint32_t i = 0; i < 1u << 22; ++i) {
            const uint32_t x = even_bits(i), y = even_bits(i >> 1);
            if (x >= side || y >= side) continue;
            const uint32_t a = y * (side + 1) + x, b = a + 1, c = a + side + 1, d = c + 1;
            triangles.emplace_back(a, b, c);
            triangles.emplace_back(b, d, c);
        }
        triangle_material.assign(triangles.size(), 0);
    }
    RasterMesh mesh() const {
        return {&positions, nullptr, nullptr, &triangles, &triangle_material};
    }

    std::vector<Vec3> positions;
    std::vector<UVec3> triangles;
    std::vector<uint16_t> triangle_material;
};

View makeBenchView(const benchmark::State& state) {
    View view = makeView(Camera{}, int(state.range(0)), int(state.range(1)), 1);
    view.focal = double(view.height);
    return view;
}

// n instances, which overlap a little and together fill a square as high as the picture; ranges as
// given.
RasterJob makeGrid(int n, const std::vector<TriangleRange>& ranges, uint32_t n_triangles) {
    const int side = int(std::ceil(std::sqrt(n)));
    RasterJob job;
    job.ranges = ranges;
    for (int i = 0; i < n; ++i) {
        RasterDraw draw;
        draw.linear = Mat3(0.6f);
        draw.translation = Vec3(float(i % side) - 0.5f * float(side - 1),
                                float(i / side) - 0.5f * float(side - 1), float(side) + 0.4f);
        draw.first_number = uint32_t(i) * n_triangles;
        draw.range_count = uint32_t(ranges.size());
        job.draws.push_back(draw);
    }
    return job;
}

void drawJob(benchmark::State& state, const Sheet& sheet, const RasterJob& job) {
    std::vector<Material> materials(1);
    materials[0].double_sided = true;
    const std::vector<Texture> textures;
    const auto rasterizer = makeOsmesaRasterizer({sheet.mesh()}, materials, textures, 0);
    const View view = makeBenchView(state);
    RasterTarget target;
    rasterizer->render(view, job, target);  // uploads and compiles
    for (auto _ : state) rasterizer->render(view, job, target);
    const auto covered = target.number.size() -
                         size_t(std::count(target.number.begin(), target.number.end(), kNoNumber));
    if (covered == 0) state.SkipWithError("nothing was drawn");
    double triangles = 0.0;
    for (const TriangleRange& r : job.ranges)
        triangles += double(r.count) * double(job.draws.size());
    state.counters["triangles"] =
        benchmark::Counter(triangles, benchmark::Counter::kIsIterationInvariantRate);
    state.counters["covered"] = double(covered) / double(target.number.size());
}

void denseMesh(benchmark::State& state) {
    const Sheet sheet(1'000'000);
    const uint32_t n = uint32_t(sheet.triangles.size());
    drawJob(state, sheet, makeGrid(1, {{0, n}}, n));
}

void wholeInstances(benchmark::State& state) {
    const Sheet sheet(20'000);
    const uint32_t n = uint32_t(sheet.triangles.size());
    drawJob(state, sheet, makeGrid(1000, {{0, n}}, n));
}

void shortRanges(benchmark::State& state) {
    const Sheet sheet(20'000);
    std::vector<TriangleRange> ranges;
    for (uint32_t i = 0; i < 50; ++i) ranges.push_back({i * 397, 64});
    drawJob(state, sheet, makeGrid(2000, ranges, uint32_t(sheet.triangles.size())));
}

// One small triangle: what is left is clearing and reading back.
void clearAndReadBack(benchmark::State& state) {
    const Sheet sheet(200);
    drawJob(state, sheet, makeGrid(1, {{0, 2}}, 1));
}

void nothing(benchmark::State& state) {
    const Sheet sheet(20'000);
    const auto rasterizer = makeOsmesaRasterizer({sheet.mesh()}, {}, {}, 0);
    RasterTarget target;
    for (auto _ : state) rasterizer->render(makeBenchView(state), {}, target);
}

void start(benchmark::State& state) {
    const Sheet sheet(200);
    const std::vector<Material> materials(1);
    const std::vector<Texture> textures;
    const RasterJob job = makeGrid(1, {{0, 100}}, 0);
    RasterTarget target;
    for (auto _ : state) {
        const auto rasterizer = makeOsmesaRasterizer({sheet.mesh()}, materials, textures, 0);
        rasterizer->render(makeBenchView(state), job, target);
    }
}

#define STIPPLE_RASTER_BENCHMARK(name)  \
    BENCHMARK(name)                     \
        ->Args({1280, 720})             \
        ->Args({5120, 2880})            \
        ->Unit(benchmark::kMillisecond) \
        ->MeasureProcessCPUTime()       \
        ->UseRealTime()
BENCHMARK(start)
    ->Args({64, 64})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();  // first: loads the library
BENCHMARK(start)
    ->Args({64, 64})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
STIPPLE_RASTER_BENCHMARK(denseMesh);
STIPPLE_RASTER_BENCHMARK(wholeInstances);
STIPPLE_RASTER_BENCHMARK(shortRanges);
STIPPLE_RASTER_BENCHMARK(clearAndReadBack);
STIPPLE_RASTER_BENCHMARK(nothing);

}  // namespace
}  // namespace stipple

BENCHMARK_MAIN();
