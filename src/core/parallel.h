// SPDX-License-Identifier: Apache-2.0
// The only door to the task system.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

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
    // indices handed out in ascending order. After an exception no more are handed out; the first
    // is rethrown on the caller when all threads have stopped.
    void forEach(size_t count, const std::function<void(size_t index, int thread)>& body);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// Sorts by `less`, which must order any two elements, so that the result is the same for any number
// of threads. In place. O(n log n).
template <class T, class Less>
void parallelSort(ThreadPool& pool, std::vector<T>& values, const Less& less) {
    constexpr size_t kSmallestRun = 16384;
    size_t n_runs = 1;
    const auto begin = [&](size_t run) {
        return values.begin() + ptrdiff_t(values.size() * run / n_runs);
    };
    // Halves, of which all of the first go before all of the second, and again.
    while (n_runs < 4 * size_t(pool.threadCount()) &&
           values.size() / (2 * n_runs) >= kSmallestRun) {
        n_runs *= 2;
        pool.forEach(n_runs / 2, [&](size_t half, int) {
            std::nth_element(begin(2 * half), begin(2 * half + 1), begin(2 * half + 2), less);
        });
    }
    pool.forEach(n_runs, [&](size_t run, int) { std::sort(begin(run), begin(run + 1), less); });
}

}  // namespace stipple
