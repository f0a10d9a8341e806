// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <raster/gl_renderer.h>
#include <raster/osmesa_context.h>

#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <future>
#include <mutex>
#include <optional>
#include <thread>

namespace stipple {

namespace {

// Owns the thread on which the context is current: a context belongs to a thread, and llvmpipe
// changes the float mode of its own.
class OsmesaRasterizer : public Rasterizer {
public:
    OsmesaRasterizer(std::vector<RasterMesh> meshes, const std::vector<Material>& materials,
                     const std::vector<Texture>& textures)
        : thread_([this] { run(); }) {
        try {
            call([&] {
                context_.emplace();
                renderer_.emplace(context_->gl(), std::move(meshes), materials, textures);
            });
        } catch (...) {
            stop();
            throw;
        }
    }
    ~OsmesaRasterizer() override { stop(); }

    void render(const View& view, const RasterJob& job, RasterTarget& target) override {
        call([&] { renderer_->render(view, job, target); });
    }

private:
    // Runs `body` on the GL thread and waits; rethrows what it throws.
    template <class Body>
    void call(Body&& body) {
        std::packaged_task<void()> task(std::forward<Body>(body));
        std::future<void> done = task.get_future();
        {
            const std::lock_guard lock(mutex_);
            tasks_.push_back(std::move(task));
        }
        wake_.notify_one();
        done.get();
    }

    void run() {
        for (;;) {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [&] { return stopping_ || !tasks_.empty(); });
            if (tasks_.empty()) break;
            std::packaged_task<void()> task = std::move(tasks_.front());
            tasks_.pop_front();
            lock.unlock();
            task();
        }
        renderer_.reset();
        context_.reset();
    }

    void stop() {
        {
            const std::lock_guard lock(mutex_);
            stopping_ = true;
        }
        wake_.notify_one();
        thread_.join();
    }

    // Touched by the GL thread only.
    std::optional<OsmesaContext> context_;
    std::optional<GlRenderer> renderer_;

    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<std::packaged_task<void()>> tasks_;
    bool stopping_ = false;
    std::thread thread_;  // last: it uses all of the above
};

}  // namespace

std::unique_ptr<Rasterizer> makeOsmesaRasterizer(std::vector<RasterMesh> meshes,
                                                 const std::vector<Material>& materials,
                                                 const std::vector<Texture>& textures,
                                                 int n_threads) {
    // llvmpipe reads this when the first context of the process is made. Its threads come on top of
    // the one that feeds them, so that a single thread must have none.
    if (n_threads > 0)
        setenv("LP_NUM_THREADS", std::to_string(n_threads == 1 ? 0 : n_threads).c_str(), 1);
    return std::make_unique<OsmesaRasterizer>(std::move(meshes), materials, textures);
}

}  // namespace stipple
