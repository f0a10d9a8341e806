// SPDX-License-Identifier: Apache-2.0
// A scene that is edited while it is looked at: frames and edits take turns, so a frame sees one
// state of the scene, and an edit from another thread waits for the end of a frame at most.
#pragma once

#include <render/renderer.h>
#include <scenegraph/scene_editor.h>

#include <condition_variable>
#include <functional>
#include <mutex>

namespace stipple {

class LiveScene {
public:
    // scene: built.
    LiveScene(Scene scene, ThreadPool& pool);

    // Runs `edits` between frames; the next frame shows them. What they throw is passed on, and
    // what they had done by then stays. Thread-safe.
    void edit(const std::function<void(SceneEditor& editor)>& edits);
    // As Renderer::render(). Thread-safe: one frame at a time.
    Frame render(const FrameRequest& request);

private:
    Scene scene_;
    SceneEditor editor_;
    Renderer renderer_;
    std::mutex mutex_;  // guards all of the above
    std::mutex waiting_mutex_;
    std::condition_variable none_waits_;
    int waiting_ = 0;  // edits: they go before the next frame
};

}  // namespace stipple
