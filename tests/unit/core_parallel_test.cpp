// SPDX-License-Identifier: Apache-2.0
// Loops over many threads: every index once, and what happens after an exception.
#include <core/parallel.h>
#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <thread>

namespace stipple {
namespace {

TEST(CoreParallel, everyIndexComesOnceInOneOfTheThreads) {
    for (const int threads : {1, 2, 5}) {
        ThreadPool pool(threads);
        ASSERT_EQ(pool.threadCount(), threads);
        std::vector<std::atomic<int>> calls(1000);
        std::atomic<int> wrong_threads{0};
        pool.forEach(calls.size(), [&](size_t i, int thread) {
            ++calls[i];
            wrong_threads += thread < 0 || thread >= threads;
        });
        for (const std::atomic<int>& n : calls) EXPECT_EQ(n, 1);
        EXPECT_EQ(wrong_threads, 0);
        pool.forEach(0, [](size_t, int) { FAIL() << "there is no index"; });
    }
}

TEST(CoreParallel, anExceptionEndsTheLoopOfAllThreads) {
    using namespace std::chrono_literals;
    constexpr size_t kCount = 2000;
    ThreadPool pool(2);
    std::atomic<size_t> calls{0};
    const auto body = [&](size_t i, int) {
        ++calls;
        if (i > 0) {
            std::this_thread::sleep_for(1ms);
            return;
        }
        // Until the other thread is in the loop, too; not for ever, as it may never come.
        for (int n = 0; n < 1000 && calls < 2; ++n) std::this_thread::sleep_for(1ms);
        throw std::runtime_error("the first");
    };
    EXPECT_THROW(pool.forEach(kCount, body), std::runtime_error);
    EXPECT_LT(calls, kCount);
    // The pool is as good as before.
    std::atomic<size_t> later{0};
    pool.forEach(kCount, [&](size_t, int) { ++later; });
    EXPECT_EQ(later, kCount);
}

}  // namespace
}  // namespace stipple
