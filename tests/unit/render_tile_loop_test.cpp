// SPDX-License-Identifier: Apache-2.0
// The frame loop over tiles and batches with a source that counts: cancelling, and what is skipped.
#include <core/error.h>
#include <gtest/gtest.h>
#include <render/tile_loop.h>

#include "point_cloud_source.h"

namespace stipple {
namespace {

// Cancels in the first batch that is drawn.
class CancellingSource : public PointSource {
public:
    explicit CancellingSource(CancelFlag& cancel) : cancel_(cancel) {}
    std::unique_ptr<TileEmitter> makeEmitter() override { return std::make_unique<Emitter>(*this); }
    std::atomic<int> emitted{0};

private:
    class Emitter : public TileEmitter {
    public:
        explicit Emitter(CancellingSource& source) : source_(source) {}
        void emit(const Batch&, PointSink&) override {
            ++source_.emitted;
            source_.cancel_.requested = true;
        }
        void attributes(uint32_t, float, float, SurfaceSample&) const override {}
        void forget() override {}

    private:
        CancellingSource& source_;
    };
    CancelFlag& cancel_;
};

// Everything for drawTiles(), of an empty scene.
struct Loop {
    explicit Loop(const TestFrame& frame)
        : view(frame.view()), picture(view, frame.lighting, {}, false) {
        request.settings = drawnSettings(frame.settings);
        context.view = view;
        context.settings = request.settings;
        context.materials = &frame.materials;
        context.lighting = &frame.lighting;
        context.picture = &picture;
    }
    Batch batch(float z_min, float expected_points) const {
        Batch b;
        b.rect = {0, 0, view.subWidth(), view.subHeight()};
        b.z_min = z_min;
        b.expected_points = expected_points;
        return b;
    }
    FrameStats draw(PointSource& source, const std::vector<Batch>& batches, int threads) {
        ThreadPool pool(threads);
        FrameStats stats;
        drawTiles(
            context, &source, batches, [](uint32_t, float, float, SurfaceSample&) {}, pool, request,
            stats);
        return stats;
    }

    View view;
    Picture picture;
    FrameRequest request;
    ReconstructionContext context;
};

TEST(RenderTileLoop, cancelsBetweenTheBatchesOfATile) {
    const TestFrame frame;
    Loop loop(frame);
    CancelFlag cancel;
    loop.request.cancel = &cancel;
    CancellingSource source(cancel);
    try {
        loop.draw(source, std::vector<Batch>(100, loop.batch(1.0f, 1.0f)), 1);
        FAIL() << "was not cancelled";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
    EXPECT_EQ(source.emitted, 1);
}

// A plane that leaves no gap hides what is behind it: as many points for any size of the tiles.
// (Small ones, in which what is hidden is known at once.)
TEST(RenderTileLoop, countsHiddenPointsOnceForAnyTiles) {
    TestFrame frame;
    frame.settings.samples = 4.0;
    std::vector<TestPoint> points;
    frame.addPlane(points, -1, 61, -1, 41, 10.0f, 0.0f, 0, 3);
    PointCloudSource source(points);
    for (const int tile_size : {16, 33, 50}) {
        frame.settings.tile_size = tile_size;
        Loop loop(frame);
        Batch corner = loop.batch(30.0f, 10.0f);
        corner.rect.x1 = corner.rect.y1 = 21;
        const std::vector<Batch> batches = {loop.batch(10.0f, float(points.size())),
                                            loop.batch(20.0f, 1000.0f), corner};
        EXPECT_EQ(loop.draw(source, batches, 1).points_culled, 1010u) << tile_size;
        EXPECT_EQ(loop.draw(source, batches, 3).points_culled, 1010u) << tile_size;
        EXPECT_EQ(loop.draw(source, {batches[0]}, 1).points_culled, 0u);
    }
}

TEST(RenderTileLoop, smallPicturesAreSharedToo) {
    TestFrame frame;
    const auto tiles = [&](int width, int height, int subpixels) {
        frame.settings.width = width, frame.settings.height = height;
        frame.settings.subpixels = subpixels;
        const View view = frame.view();
        const int side = tileSide(view, 384);
        return ((view.subWidth() + side - 1) / side) * ((view.subHeight() + side - 1) / side);
    };
    EXPECT_GE(tiles(128, 72, 1), 12);
    EXPECT_GE(tiles(640, 480, 1), 12);
    EXPECT_EQ(tiles(16, 16, 1), 1);       // too little to share
    EXPECT_EQ(tiles(1920, 1200, 2), 70);  // as large as may be
}

}  // namespace
}  // namespace stipple
