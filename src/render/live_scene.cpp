// SPDX-License-Identifier: Apache-2.0
#include <render/live_scene.h>

namespace stipple {

LiveScene::LiveScene(Scene scene, ThreadPool& pool)
    : scene_(std::move(scene)), editor_(scene_), renderer_(scene_, pool) {}

void LiveScene::edit(const std::function<void(SceneEditor&)>& edits) {
    {
        const std::lock_guard lock(waiting_mutex_);
        ++waiting_;
    }
    struct Done {
        LiveScene& scene;
        ~Done() {
            const std::lock_guard lock(scene.waiting_mutex_);
            if (--scene.waiting_ == 0) scene.none_waits_.notify_all();
        }
    } done{*this};
    const std::lock_guard lock(mutex_);
    edits(editor_);
}

Frame LiveScene::render(const FrameRequest& request) {
    {
        std::unique_lock lock(waiting_mutex_);
        none_waits_.wait(lock, [&] { return waiting_ == 0; });
    }
    const std::lock_guard lock(mutex_);
    renderer_.sceneChanged(editor_.takeChanges());
    return renderer_.render(request);
}

}  // namespace stipple
