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
// of threads. Needs the memory of `values` once more. O(n log n).
template <class T, class Less>
void parallelSort(ThreadPool& pool, std::vector<T>& values, const Less& less) {
    constexpr size_t kSmallestRun = 16384;
    size_t n_runs = 1;
    while (n_runs < 4 * size_t(pool.threadCount()) && values.size() / (2 * n_runs) >= kSmallestRun)
        n_runs *= 2;
    const auto begin = [&](size_t run) { return values.size() * run / n_runs; };
    pool.forEach(n_runs, [&](size_t run, int) {
        std::sort(values.begin() + begin(run), values.begin() + begin(run + 1), less);
    });
    if (n_runs == 1) return;
    std::vector<T> merged(values.size());
    for (; n_runs > 1; n_runs /= 2, values.swap(merged)) {
        pool.forEach(n_runs / 2, [&](size_t pair, int) {
            const size_t a = begin(2 * pair), b = begin(2 * pair + 1), end = begin(2 * pair + 2);
            std::merge(values.begin() + a, values.begin() + b, values.begin() + b,
                       values.begin() + end, merged.begin() + a, less);
        });
    }
}

}  // namespace stipple
