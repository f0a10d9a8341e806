// SPDX-License-Identifier: Apache-2.0
// The only door to the task system.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>

namespace stipple {

// Raised from a signal handler or another thread; long work looks at it and throws
// Error(kCancelled).
struct CancelFlag {
    std::atomic<bool> requested{false};
};

// A fixed number of worker threads (0: one a core). Loops started through it use no more.
class ThreadPool {
public:
    explicit ThreadPool(int n_threads = 0);
    ~ThreadPool();

    int threadCount() const;
    // Calls body(index, thread) for every index in [0, count), thread in [0, threadCount()),
    // indices handed out in ascending order. The first exception is rethrown on the caller when all
    // threads have stopped.
    void forEach(size_t count, const std::function<void(size_t index, int thread)>& body);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace stipple
