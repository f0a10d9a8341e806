// SPDX-License-Identifier: Apache-2.0
// Draws what the viewer shows on a thread of its own: coarse while the camera moves, then finer and
// finer.
#pragma once

#include <render/live_scene.h>

#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>

namespace stipple {

// What is to be seen. settings: those of the finest picture.
struct ViewWish {
    Camera camera;
    RenderSettings settings;
    double frame_seconds = 0.05;  // target while the camera moves
    // As FrameRequest has them.
    bool wants_cut = false, tints_kinds = false;
    // Refines in place by 1, 10, 50, 75 and 100 % of the points, rather than from coarse to fine.
    bool sparkles = false;
};

struct ShownPicture {
    Image image;  // with depth, object and count
    std::vector<CutBox> cut;
    View view;
    FrameStats stats;
    int level = 0, level_count = 0;
    double percent = 0.0;       // of the points that the finest picture is to have
    double full_seconds = 0.0;  // since the first of its view was begun
};

class ViewRenderer {
public:
    explicit ViewRenderer(LiveScene& scene);
    ~ViewRenderer();

    // Drawing of what was wished before stops at once.
    void show(const ViewWish& wish);
    // Lets an edit through: stops the frame, edits, and draws what it was drawing anew.
    void edit(const std::function<void(SceneEditor& editor)>& edits);
    // The newest picture, if there is one that has not been taken. Throws what drawing threw.
    bool take(ShownPicture& picture);

private:
    void run();
    RenderSettings settingsOf(const ViewWish& wish, int level) const;
    static int levelCount(const ViewWish& wish);

    LiveScene& scene_;
    std::mutex mutex_;  // guards what follows
    std::condition_variable wished_;
    ViewWish wish_;
    uint64_t version_ = 0;
    bool has_wish_ = false, is_ending_ = false, is_new_ = false;
    std::shared_ptr<CancelFlag> cancel_;  // of the frame that is being drawn
    ShownPicture picture_;
    std::exception_ptr error_;
    double coarse_scale_ = 1.0;  // of the moving picture's sides
    std::thread thread_;
};

}  // namespace stipple
