// SPDX-License-Identifier: Apache-2.0
// The frame loop over tiles and batches with a source that counts: cancelling, and what is skipped.
#include <core/error.h>
#include <gtest/gtest.h>

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

TEST(RenderTileLoop, cancelsBetweenTheBatchesOfATile) {
    const TestFrame frame;
    const View view = frame.view();
    Picture picture(view, frame.lighting, {}, false);
    CancelFlag cancel;
    FrameRequest request;
    request.settings = drawnSettings(frame.settings);
    request.cancel = &cancel;
    ReconstructionContext context;
    context.view = view;
    context.settings = request.settings;
    context.materials = &frame.materials;
    context.lighting = &frame.lighting;
    context.picture = &picture;
    Batch batch;
    batch.rect = {0, 0, view.subWidth(), view.subHeight()};
    batch.z_min = 1.0f;
    CancellingSource source(cancel);
    ThreadPool pool(1);
    FrameStats stats;
    const auto draw = [&] {
        drawTiles(
            context, &source, std::vector<Batch>(100, batch),
            [](uint32_t, float, float, SurfaceSample&) {}, pool, request, stats);
    };
    try {
        draw();
        FAIL() << "was not cancelled";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
    EXPECT_EQ(source.emitted, 1);
}

}  // namespace
}  // namespace stipple
