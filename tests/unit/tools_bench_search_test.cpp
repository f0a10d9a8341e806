// SPDX-License-Identifier: Apache-2.0
// The search for settings, over made-up costs and qualities.
#include <gtest/gtest.h>
#include <tools/bench_search.h>

#include <cmath>

namespace stipple {
namespace {

// Time follows the points, quality their logarithm; large triangles as points are good but slow.
SearchStep model(const RenderSettings& s) {
    SearchStep step;
    step.settings = s;
    const double points = s.subpixels * s.subpixels * s.samples;
    step.psnr_db = 20.0 + 10.0 * std::log10(s.subpixels * s.subpixels) +
                   3.0 * std::min(1.0, std::log2(s.samples)) -
                   (s.area_threshold > 32.0 ? 2.0 : 0.0);
    step.seconds = 0.01 * points * (s.area_threshold == 16.0 ? 0.5 : 1.0);
    return step;
}

RenderSettings base() {
    RenderSettings settings;
    settings.seed = 77;
    return settings;
}

TEST(ToolsBenchSearch, findsTheFastestForEachQuality) {
    const std::vector<SearchStep> steps = searchSettings(base(), {22.0, 28.0, 33.0}, 100.0, model);
    for (const SearchStep& step : steps) EXPECT_EQ(step.settings.seed, 77u);
    for (const double wanted : {22.0, 28.0, 33.0}) {
        const SearchStep* found = fastestStep(steps, wanted);
        ASSERT_TRUE(found);
        EXPECT_GE(found->psnr_db, wanted);
        EXPECT_EQ(found->settings.area_threshold, 16.0) << "half the time";
        // As fast as anything on the whole grid with the default threshold.
        for (const int subpixels : {1, 2, 3, 4, 5, 6, 8}) {
            for (const double samples : {0.5, 1.0, 2.0, 4.0}) {
                RenderSettings other = base();
                other.subpixels = subpixels;
                other.samples = samples;
                const SearchStep step = model(other);
                if (step.psnr_db >= wanted) {
                    EXPECT_LE(found->seconds, step.seconds);
                }
            }
        }
    }
}

TEST(ToolsBenchSearch, givesUpWhereNothingIsFastEnough) {
    size_t slow = 0, total = 0;
    const double limit = 0.2;
    const auto steps =
        searchSettings(base(), {20.0, 90.0}, limit, [&](const RenderSettings& settings) {
            const SearchStep step = model(settings);
            ++total;
            slow += step.seconds > limit;
            return step;
        });
    EXPECT_EQ(total, steps.size());
    EXPECT_EQ(fastestStep(steps, 90.0), nullptr);
    ASSERT_TRUE(fastestStep(steps, 20.0));
    EXPECT_GT(bestStep(steps).psnr_db, 30.0);
    EXPECT_LE(slow, 8u);
    EXPECT_LT(total, 30u);
}

TEST(ToolsBenchSearch, theOrderOfTheQualitiesMakesNoDifference) {
    const auto sorted = searchSettings(base(), {22.0, 28.0, 33.0}, 0.5, model);
    const auto other = searchSettings(base(), {33.0, 22.0, 28.0}, 0.5, model);
    for (const double wanted : {22.0, 28.0, 33.0}) {
        ASSERT_TRUE(fastestStep(other, wanted));
        EXPECT_EQ(fastestStep(other, wanted)->seconds, fastestStep(sorted, wanted)->seconds);
    }
}

// Steps of equal true quality that noise lets pass or not: the fastest passed by luck.
TEST(ToolsBenchSearch, whatPassedByLuckIsNotTaken) {
    std::vector<SearchStep> steps(5);
    const double seconds[] = {3.0, 1.0, 2.0, 0.5, 2.5}, found_db[] = {31, 30.1, 30.2, 29.9, 33};
    for (int i = 0; i < 5; ++i) {
        steps[i].settings.subpixels = i + 1;
        steps[i].seconds = seconds[i];
        steps[i].psnr_db = found_db[i];
    }
    const double again_db[] = {30.5, 29.8, 29.9, 31.0, 30.0};
    std::vector<int> asked;
    const auto psnrAgain = [&](const RenderSettings& settings) {
        asked.push_back(settings.subpixels);
        return again_db[settings.subpixels - 1];
    };
    EXPECT_EQ(fastestConfirmedStep(steps, 30.0, psnrAgain), &steps[4]);
    EXPECT_EQ(asked, (std::vector<int>{2, 3, 5})) << "by their times; what failed is not asked";
    EXPECT_EQ(fastestConfirmedStep(steps, 30.8, psnrAgain), nullptr);
    asked.clear();
    EXPECT_EQ(fastestConfirmedStep(steps, 40.0, psnrAgain), nullptr);
    EXPECT_TRUE(asked.empty());
}

TEST(ToolsBenchSearch, triesNoSettingsTwice) {
    const auto steps = searchSettings(base(), {21.0, 21.5, 22.0}, 100.0, model);
    for (size_t i = 0; i < steps.size(); ++i) {
        for (size_t j = 0; j < i; ++j) {
            EXPECT_FALSE(steps[i].settings.subpixels == steps[j].settings.subpixels &&
                         steps[i].settings.samples == steps[j].settings.samples &&
                         steps[i].settings.area_threshold == steps[j].settings.area_threshold &&
                         steps[i].settings.visible_size == steps[j].settings.visible_size);
        }
    }
}

TEST(ToolsBenchSearch, anEqualPictureIsReached) {
    const auto steps =
        searchSettings(base(), {double(kInfinity)}, 100.0, [](const RenderSettings& settings) {
            SearchStep step;
            step.settings = settings;
            step.psnr_db = kInfinity;
            step.seconds = 0.01 * settings.subpixels;
            return step;
        });
    ASSERT_TRUE(fastestStep(steps, kInfinity));
    EXPECT_EQ(fastestStep(steps, kInfinity)->settings.subpixels, 1);
}

}  // namespace
}  // namespace stipple
