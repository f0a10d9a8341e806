// SPDX-License-Identifier: Apache-2.0
#include <core/parallel.h>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <thread>

namespace stipple {

struct ThreadPool::Impl {
    explicit Impl(int n)
        : limit(tbb::global_control::max_allowed_parallelism, size_t(n) + 1),
          arena(n),
          n_threads(n) {}
    tbb::global_control limit;  // or TBB warns of more threads than cores
    tbb::task_arena arena;
    int n_threads;
};

ThreadPool::ThreadPool(int n_threads)
    : impl_(std::make_unique<Impl>(
          n_threads > 0 ? n_threads : std::max(1u, std::thread::hardware_concurrency()))) {}
ThreadPool::~ThreadPool() = default;

int ThreadPool::threadCount() const { return impl_->n_threads; }

void ThreadPool::forEach(size_t count, const std::function<void(size_t, int)>& body) {
    // One task a thread and a shared counter: indices go out in ascending order and `thread` is
    // exclusive to a task. TBB only keeps tasks from starting after an exception; those that run
    // look at has_failed. The counter also orders memory between caller and tasks, which TBB does,
    // too, but ThreadSanitizer does not see there.
    std::atomic<size_t> next{0};
    next.store(0, std::memory_order_release);
    std::atomic<bool> has_failed{false};
    const size_t tasks = std::min(count, size_t(impl_->n_threads));
    impl_->arena.execute([&] {
        tbb::parallel_for(
            size_t(0), tasks,
            [&](size_t thread) {
                try {
                    for (size_t i; !has_failed.load(std::memory_order_relaxed) &&
                                   (i = next.fetch_add(1, std::memory_order_acq_rel)) < count;)
                        body(i, int(thread));
                } catch (...) {
                    has_failed = true;
                    throw;
                }
            },
            tbb::simple_partitioner());
    });
    next.load(std::memory_order_acquire);
}

}  // namespace stipple
