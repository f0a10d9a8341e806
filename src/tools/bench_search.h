// SPDX-License-Identifier: Apache-2.0
// The point method's fastest settings for a wanted quality, found by trying.
#pragma once

#include <tools/bench.h>

#include <functional>
#include <vector>

namespace stipple {

// Draws with settings and says how well and how fast.
using TrySettings = std::function<SearchStep(const RenderSettings&)>;

// Tries subpixels and samples, from cheap to dear, until all wanted PSNRs (in any order) are
// reached or a frame takes longer than limit_seconds; then other area thresholds around what was
// best. Returns every step.
std::vector<SearchStep> searchSettings(const RenderSettings& base,
                                       const std::vector<double>& wanted_db, double limit_seconds,
                                       const TrySettings& attempt);

// The fastest step that reaches a PSNR; nullptr if none does.
const SearchStep* fastestStep(const std::vector<SearchStep>& steps, double wanted_db);
// The fastest step that reaches a PSNR and does so again: psnrAgain draws with other random numbers
// than the search. The fastest of many that just reached it is likely to have been lucky. Asks in
// the order of their times until one does; nullptr if none does.
const SearchStep* fastestConfirmedStep(
    const std::vector<SearchStep>& steps, double wanted_db,
    const std::function<double(const RenderSettings&)>& psnrAgain);
// The one of the highest PSNR.
const SearchStep& bestStep(const std::vector<SearchStep>& steps);

}  // namespace stipple
