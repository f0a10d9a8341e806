// SPDX-License-Identifier: Apache-2.0
#include <tools/view_renderer.h>

#include <core/stopwatch.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace stipple {

ViewRenderer::ViewRenderer(LiveScene& scene)
    : scene_(scene), cancel_(std::make_shared<CancelFlag>()), thread_([this] { run(); }) {}

ViewRenderer::~ViewRenderer() {
    {
        const std::lock_guard lock(mutex_);
        is_ending_ = true;
        cancel_->requested = true;
    }
    wished_.notify_all();
    thread_.join();
}

void ViewRenderer::show(const ViewWish& wish) {
    {
        const std::lock_guard lock(mutex_);
        wish_ = wish;
        has_wish_ = true;
        ++version_;
        cancel_->requested = true;
    }
    wished_.notify_all();
}

void ViewRenderer::edit(const std::function<void(SceneEditor&)>& edits) {
    {
        const std::lock_guard lock(mutex_);
        ++version_;
        cancel_->requested = true;
    }
    scene_.edit(edits);
    wished_.notify_all();
}

bool ViewRenderer::take(ShownPicture& picture) {
    const std::lock_guard lock(mutex_);
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    if (!is_new_) return false;
    is_new_ = false;
    picture = std::move(picture_);
    return true;
}

namespace {

// Level 0, while the camera moves, is as small as the frame time asks for. Then full size: with a
// sample a pixel, with four, and as was wished; or sparkling in.
constexpr int kCoarseLevels = 4;
constexpr double kSparkles[] = {1.0, 10.0, 50.0, 75.0, 100.0};  // per cent
constexpr double kLeastSamples = 0.001;                         // as the settings table has it
constexpr double kSmallest = 0.08;  // of the sides, while the camera moves
constexpr double kAim = 0.9;        // of the time asked for: frames differ, and some are late

double pointsOf(const RenderSettings& s) {
    return s.samples * s.subpixels * s.subpixels * s.width * s.height;
}

}  // namespace

int ViewRenderer::levelCount(const ViewWish& wish) {
    return wish.sparkles ? 1 + int(std::size(kSparkles)) : kCoarseLevels;
}

RenderSettings ViewRenderer::settingsOf(const ViewWish& wish, int level) const {
    RenderSettings s = wish.settings;
    if (level > 0 && wish.sparkles) {
        s.samples = std::max(kLeastSamples, s.samples * kSparkles[level - 1] / 100.0);
    } else if (level < kCoarseLevels - 1) {
        s.samples = std::min(1.0, s.samples);
        s.subpixels = std::min(s.subpixels, level == 2 ? 2 : 1);
        s.area_threshold = 16.0;
        s.visible_size = 96.0;
        s.shadows = s.shadows && level > 0;
    }
    if (level == 0) {
        s.width = std::max(16, int(s.width * coarse_scale_));
        s.height = std::max(16, int(s.height * coarse_scale_));
    }
    return s;
}

void ViewRenderer::run() {
    uint64_t drawn_version = 0;
    int level = 0, level_count = 0;  // the next to draw, of so many
    Stopwatch view_watch;
    for (;;) {
        FrameRequest request;
        ViewWish wish;
        std::shared_ptr<CancelFlag> cancel;
        {
            std::unique_lock lock(mutex_);
            wished_.wait(lock, [&] {
                return is_ending_ ||
                       (has_wish_ && (version_ != drawn_version || level < level_count));
            });
            if (is_ending_) return;
            wish = wish_;
            if (version_ != drawn_version) {
                drawn_version = version_, level = 0;
                level_count = levelCount(wish);
                view_watch = Stopwatch();
            }
            cancel_ = cancel = std::make_shared<CancelFlag>();
        }
        request.camera = wish.camera;
        request.settings = settingsOf(wish, level);
        request.aovs = {"depth", "object", "count"};
        request.wants_cut = wish.wants_cut;
        request.tints_kinds = wish.tints_kinds;
        // A first picture is drawn whole even where the camera has moved on: a camera that never
        // rests would leave none.
        if (level > 0) request.cancel = cancel.get();
        Frame frame;
        try {
            frame = scene_.render(request);
        } catch (const Error& error) {
            if (error.code() == ErrorCode::kCancelled) continue;
            const std::lock_guard lock(mutex_);
            error_ = std::current_exception();
            level = level_count;
            continue;
        }
        if (level == 0) {
            const double factor =
                std::sqrt(kAim * wish.frame_seconds / std::max(frame.stats.seconds, 1e-3));
            coarse_scale_ =
                std::clamp(coarse_scale_ * std::clamp(factor, 0.7, 1.2), kSmallest, 1.0);
        }
        const std::lock_guard lock(mutex_);
        picture_.view = makeView(request.camera, request.settings.width, request.settings.height,
                                 request.settings.subpixels);
        picture_.image = std::move(frame.image);
        picture_.cut = std::move(frame.cut);
        picture_.stats = std::move(frame.stats);
        picture_.level = level;
        picture_.level_count = level_count;
        picture_.percent = 100.0 * pointsOf(request.settings) / pointsOf(wish.settings);
        picture_.full_seconds = view_watch.seconds();
        is_new_ = true;
        const bool is_full_size = level == 0 && coarse_scale_ >= 1.0 && !wish.sparkles;
        level = is_full_size ? 2 : level + 1;
    }
}

}  // namespace stipple
