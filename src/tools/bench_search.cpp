// SPDX-License-Identifier: Apache-2.0
#include <tools/bench_search.h>

#include <algorithm>
#include <utility>

namespace stipple {

namespace {

constexpr int kSubpixels[] = {1, 2, 3, 4, 5, 6, 8};
constexpr double kSamples[] = {0.5, 1.0, 2.0, 4.0};
// area_threshold and visible_size
constexpr std::pair<double, double> kDetails[] = {
    {1.0, 32.0}, {16.0, 32.0}, {16.0, 0.0}, {16.0, 96.0}};
constexpr double kGain = 0.1;  // dB: more points that bring less are not worth trying further

}  // namespace

const SearchStep* fastestStep(const std::vector<SearchStep>& steps, double wanted_db) {
    const SearchStep* fastest = nullptr;
    for (const SearchStep& step : steps) {
        if (step.psnr_db >= wanted_db && (!fastest || step.seconds < fastest->seconds))
            fastest = &step;
    }
    return fastest;
}

const SearchStep* fastestConfirmedStep(
    const std::vector<SearchStep>& steps, double wanted_db,
    const std::function<double(const RenderSettings&)>& psnrAgain) {
    std::vector<const SearchStep*> candidates;
    for (const SearchStep& step : steps) {
        if (step.psnr_db >= wanted_db) candidates.push_back(&step);
    }
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const SearchStep* a, const SearchStep* b) { return a->seconds < b->seconds; });
    for (const SearchStep* step : candidates) {
        if (psnrAgain(step->settings) >= wanted_db) return step;
    }
    return nullptr;
}

const SearchStep& bestStep(const std::vector<SearchStep>& steps) {
    return *std::max_element(
        steps.begin(), steps.end(),
        [](const SearchStep& a, const SearchStep& b) { return a.psnr_db < b.psnr_db; });
}

std::vector<SearchStep> searchSettings(const RenderSettings& base,
                                       const std::vector<double>& wanted_db, double limit_seconds,
                                       const TrySettings& attempt) {
    std::vector<SearchStep> steps;
    const double most_wanted = *std::max_element(wanted_db.begin(), wanted_db.end());
    for (const int subpixels : kSubpixels) {
        // The time beyond which nothing is of use.
        const auto limit = [&] {
            const SearchStep* reached = fastestStep(steps, most_wanted);
            return reached ? reached->seconds : limit_seconds;
        };
        double psnr_before = -kInfinity;
        for (const double samples : kSamples) {
            // More subpixels and more samples only take longer.
            const bool is_slow = std::any_of(steps.begin(), steps.end(), [&](const SearchStep& s) {
                return s.settings.subpixels <= subpixels && s.settings.samples <= samples &&
                       s.seconds > limit();
            });
            if (is_slow) break;
            RenderSettings settings = base;
            settings.subpixels = subpixels;
            settings.samples = samples;
            steps.push_back(attempt(settings));
            if (steps.back().psnr_db < psnr_before + kGain) break;
            psnr_before = steps.back().psnr_db;
        }
    }
    for (const double wanted : wanted_db) {
        const SearchStep* found = fastestStep(steps, wanted);
        if (!found) found = &bestStep(steps);
        const RenderSettings around = found->settings;
        std::vector<RenderSettings> others;
        for (const auto& [area, visible] : kDetails) {
            others.push_back(around);
            others.back().area_threshold = area;
            others.back().visible_size = visible;
        }
        // Between the steps of the grid.
        others.push_back(around);
        others.back().samples *= 0.7;
        for (const RenderSettings& settings : others) {
            const bool is_known =
                std::any_of(steps.begin(), steps.end(), [&](const SearchStep& step) {
                    return step.settings.subpixels == settings.subpixels &&
                           step.settings.samples == settings.samples &&
                           step.settings.area_threshold == settings.area_threshold &&
                           step.settings.visible_size == settings.visible_size;
                });
            if (!is_known) steps.push_back(attempt(settings));
        }
    }
    return steps;
}

}  // namespace stipple
