// SPDX-License-Identifier: Apache-2.0
// What other programs took of the processors.
#include <gtest/gtest.h>
#include <tools/processor_time.h>

#include <chrono>

namespace stipple {
namespace {

TEST(ProcessorTime, othersTookWhatThisProgramDidNot) {
    EXPECT_DOUBLE_EQ(othersShare({100.0, 50.0, 7.0}, {110.0, 56.0, 11.0}), 0.2);
    EXPECT_EQ(othersShare({100.0, 50.0, 7.0}, {110.0, 54.0, 11.1}), 0.0);  // counted coarsely
    EXPECT_EQ(othersShare({100.0, 50.0, 7.0}, {100.1, 50.1, 7.0}), 0.0);   // too short to tell
    EXPECT_EQ(othersShare({}, {}), 0.0);
}

TEST(ProcessorTime, ownWorkIsNotThatOfOthers) {
    const ProcessorTime before = processorTime();
    if (!(before.there > 0.0)) GTEST_SKIP() << "the system does not say";
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(300);
    while (std::chrono::steady_clock::now() < end) {
    }
    const ProcessorTime after = processorTime();
    EXPECT_GT(after.own, before.own);
    EXPECT_GT(after.there, before.there);
    const double share = othersShare(before, after);
    EXPECT_GE(share, 0.0);
    EXPECT_LE(share, 1.0);
}

}  // namespace
}  // namespace stipple
