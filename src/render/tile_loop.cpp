// SPDX-License-Identifier: Apache-2.0
#include <render/tile_loop.h>

#include <core/stopwatch.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>

namespace stipple {

namespace {

struct Tile {
    SubpixelRect inner, outer;
    bool is_wanted = true;
    std::vector<uint32_t> batches;  // front to back
};

std::vector<Tile> makeTiles(const TileJob& job, int halo) {
    const View& view = job.view;
    const int s = view.subpixels;
    const int side = std::max(1, job.tile_size / s) * s;
    std::vector<Tile> tiles;
    for (int y = 0; y < view.subHeight(); y += side) {
        for (int x = 0; x < view.subWidth(); x += side) {
            Tile tile;
            tile.inner = {x, y, std::min(x + side, view.subWidth()),
                          std::min(y + side, view.subHeight())};
            tile.outer = {std::max(0, x - halo), std::max(0, y - halo),
                          std::min(tile.inner.x1 + halo, view.subWidth()),
                          std::min(tile.inner.y1 + halo, view.subHeight())};
            tile.is_wanted = !job.is_wanted || job.is_wanted(tile.inner);
            tiles.push_back(std::move(tile));
        }
    }
    return tiles;
}

void sortIntoTiles(const TileJob& job, int halo, std::vector<Tile>& tiles) {
    const std::vector<Batch>& batches = *job.batches;
    const View& view = job.view;
    std::vector<uint32_t> order(batches.size());
    for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return batches[a].z_min != batches[b].z_min ? batches[a].z_min < batches[b].z_min : a < b;
    });
    const int side = std::max(1, job.tile_size / view.subpixels) * view.subpixels;
    const int columns = (view.subWidth() + side - 1) / side,
              rows = (view.subHeight() + side - 1) / side;
    for (const uint32_t b : order) {
        const SubpixelRect& r = batches[b].rect;
        const int x0 = std::max(0, (r.x0 - halo) / side),
                  x1 = std::min(columns - 1, (r.x1 - 1 + halo) / side);
        const int y0 = std::max(0, (r.y0 - halo) / side),
                  y1 = std::min(rows - 1, (r.y1 - 1 + halo) / side);
        for (int y = y0; y <= y1; ++y) {
            for (int x = x0; x <= x1; ++x) {
                Tile& tile = tiles[size_t(y) * columns + x];
                if (tile.is_wanted && tile.outer.overlaps(r)) tile.batches.push_back(b);
            }
        }
    }
}

// The points of a batch that are expected in a tile proper, as if they lay evenly in its rectangle.
double expectedPoints(const Batch& batch, const SubpixelRect& inner) {
    const SubpixelRect& r = batch.rect;
    const SubpixelRect common = {std::max(r.x0, inner.x0), std::max(r.y0, inner.y0),
                                 std::min(r.x1, inner.x1), std::min(r.y1, inner.y1)};
    if (common.isEmpty()) return 0.0;
    return double(batch.expected_points) * (double(common.width()) * common.height()) /
           (double(r.width()) * r.height());
}

const Vec3 kPointTint(0.1f, 0.7f, 0.1f), kTriangleTint(0.9f, 0.4f, 0.05f);

class NumberLookup : public SampleLookup {
public:
    NumberLookup(const TileEmitter* emitter, const TriangleLookup& triangles, bool tints_kinds)
        : emitter_(emitter), triangles_(triangles), tints_kinds_(tints_kinds) {}
    void lookUp(uint32_t number, float sub_x, float sub_y, SurfaceSample& sample) const override {
        if (number & kZBufferBit) {
            triangles_(number & ~kZBufferBit, sub_x, sub_y, sample);
        } else {
            emitter_->attributes(number, sub_x, sub_y, sample);
        }
        if (tints_kinds_) sample.albedo = (number & kAnyTriangle) ? kTriangleTint : kPointTint;
    }
    void prefetch(uint32_t number) const override {
        if (!(number & kZBufferBit)) emitter_->prefetch(number);
    }

private:
    const TileEmitter* emitter_;
    const TriangleLookup& triangles_;
    const bool tints_kinds_;
};

// What a thread keeps from tile to tile.
struct Worker {
    std::unique_ptr<TileEmitter> emitter;
    std::unique_ptr<TileReconstruction> reconstruction;
    double draw_seconds = 0.0, finish_seconds = 0.0;
};

}  // namespace

int tileSide(const View& view, int largest) {
    constexpr double kFewestTiles = 12.0;
    constexpr int kSmallest = 32;
    const double area = double(view.subWidth()) * double(view.subHeight());
    return std::min(std::max(int(std::ceil(std::sqrt(area / kFewestTiles))), kSmallest), largest);
}

TileTimes runTiles(const TileJob& job, ThreadPool& pool, const FrameRequest& request,
                   FrameStats& stats) {
    const int halo = job.makeReconstruction()->halo();
    std::vector<Tile> tiles = makeTiles(job, halo);
    sortIntoTiles(job, halo, tiles);

    std::vector<Worker> workers(pool.threadCount());
    std::vector<double> culled(tiles.size());  // not by worker: the same sum for any threads
    std::atomic<size_t> done{0};
    std::mutex progress_mutex;
    pool.forEach(tiles.size(), [&](size_t t, int thread) {
        if (!tiles[t].is_wanted || (request.cancel && request.cancel->requested)) return;
        Worker& worker = workers[thread];
        if (!worker.reconstruction) {
            worker.reconstruction = job.makeReconstruction();
            if (job.source) worker.emitter = job.source->makeEmitter();
        }
        TileReconstruction& reconstruction = *worker.reconstruction;
        const NumberLookup lookup(worker.emitter.get(), *job.triangle_lookup, request.tints_kinds);
        const Tile& tile = tiles[t];

        const Stopwatch draw_watch;
        reconstruction.beginTile(tile.inner, tile.outer);
        for (int pass = 0; pass < reconstruction.passCount(); ++pass) {
            reconstruction.beginPass(pass, lookup);
            for (const uint32_t b : tile.batches) {
                if (request.cancel && request.cancel->requested) return;
                const Batch& batch = (*job.batches)[b];
                if (reconstruction.hides(batch.rect, batch.z_min, false)) {
                    if (pass == 0) culled[t] += expectedPoints(batch, tile.inner);
                } else {
                    worker.emitter->emit(batch, reconstruction);
                }
            }
        }
        worker.draw_seconds += draw_watch.seconds();
        const Stopwatch finish_watch;
        reconstruction.endTile(lookup);
        if (worker.emitter) worker.emitter->forget();
        worker.finish_seconds += finish_watch.seconds();

        const size_t n = ++done;
        if (request.progress && n % 4 == 0) {
            const std::lock_guard lock(progress_mutex);
            request.progress(job.phase, double(n) / double(tiles.size()));
        }
    });
    if (request.cancel && request.cancel->requested)
        throw Error(ErrorCode::kCancelled, "", "cancelled");

    TileTimes times;
    for (const Worker& worker : workers) {
        if (!worker.reconstruction) continue;
        const TileCounters counters = worker.reconstruction->counters();
        stats.points_drawn += counters.points_drawn;
        stats.points_kept += counters.points_kept;
        stats.small_triangles += counters.triangles;
        times.draw += worker.draw_seconds;
        times.finish += worker.finish_seconds;
    }
    stats.points_culled +=
        uint64_t(std::llround(std::accumulate(culled.begin(), culled.end(), 0.0)));
    return times;
}

void drawTiles(const ReconstructionContext& context, PointSource* source,
               const std::vector<Batch>& batches, const TriangleLookup& triangle_lookup,
               ThreadPool& pool, const FrameRequest& request, FrameStats& stats) {
    if (request.progress) request.progress("draw", 0.0);
    TileJob job;
    job.view = context.view;
    job.tile_size = context.settings.tile_size;
    job.makeReconstruction = [&] { return makeReconstruction(context); };
    job.source = source;
    job.batches = &batches;
    job.triangle_lookup = &triangle_lookup;
    const TileTimes times = runTiles(job, pool, request, stats);
    stats.batches = batches.size();
    stats.phases.emplace_back("draw", times.draw / pool.threadCount());
    stats.phases.emplace_back("reconstruct", times.finish / pool.threadCount());
}

}  // namespace stipple
