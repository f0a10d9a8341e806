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
};

struct ShownPicture {
    Image image;  // with depth and object
    View view;
    FrameStats stats;
    int level = 0;  // of kLevels
};

class ViewRenderer {
public:
    static constexpr int kLevels = 4;

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
