// SPDX-License-Identifier: Apache-2.0
#include <core/parallel.h>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <exception>
#include <mutex>
#include <thread>

namespace stipple {

#if defined(__SANITIZE_THREAD__)

// ThreadSanitizer does not see how TBB hands work over, and would report every loop. Plain threads
// for each loop are slow, but what it reports then is ours.
struct ThreadPool::Impl {
    explicit Impl(int n) : n_threads(n) {}

    void run(size_t tasks, const std::function<void(size_t)>& task) {
        std::exception_ptr failure;
        std::mutex failure_mutex;
        std::vector<std::thread> threads;
        for (size_t t = 0; t < tasks; ++t) {
            threads.emplace_back([&, t] {
                try {
                    task(t);
                } catch (...) {
                    const std::lock_guard lock(failure_mutex);
                    if (!failure) failure = std::current_exception();
                }
            });
        }
        for (std::thread& thread : threads) thread.join();
        if (failure) std::rethrow_exception(failure);
    }
    int n_threads;
};

#else

struct ThreadPool::Impl {
    explicit Impl(int n)
        : limit(tbb::global_control::max_allowed_parallelism, size_t(n) + 1),
          arena(n),
          n_threads(n) {}

    void run(size_t tasks, const std::function<void(size_t)>& task) {
        arena.execute(
            [&] { tbb::parallel_for(size_t(0), tasks, task, tbb::simple_partitioner()); });
    }
    tbb::global_control limit;  // or TBB warns of more threads than cores
    tbb::task_arena arena;
    int n_threads;
};

#endif

ThreadPool::ThreadPool(int n_threads)
    : impl_(std::make_unique<Impl>(
          n_threads > 0 ? n_threads : std::max(1u, std::thread::hardware_concurrency()))) {}
ThreadPool::~ThreadPool() = default;

int ThreadPool::threadCount() const { return impl_->n_threads; }

void ThreadPool::forEach(size_t count, const std::function<void(size_t, int)>& body) {
    // One task a thread and a shared counter: indices go out in ascending order and `thread` is
    // exclusive to a task. After an exception tasks are only kept from starting; those that run
    // look at has_failed.
    std::atomic<size_t> next{0};
    std::atomic<bool> has_failed{false};
    impl_->run(std::min(count, size_t(impl_->n_threads)), [&](size_t thread) {
        try {
            for (size_t i; !has_failed.load(std::memory_order_relaxed) &&
                           (i = next.fetch_add(1, std::memory_order_relaxed)) < count;)
                body(i, int(thread));
        } catch (...) {
            has_failed = true;
            throw;
        }
    });
}

}  // namespace stipple
