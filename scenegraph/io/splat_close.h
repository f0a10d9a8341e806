// SPDX-License-Identifier: Apache-2.0
// How wide splats are drawn: no wider than leaves no gap between them from any direction. Where a
// surface is bent the rim of a splat stands out over its silhouette, by more the wider it is.
#pragma once

#include <scenegraph/io/splat_choice.h>

namespace stipple {

// Makes splats ellipses with no gap around them: first little larger than what covers their points,
// then larger on the sides where a line beside the rim meets none of the splats around, but has
// points on all sides, so that one would look through. splats: those chosen, perhaps with more
// cuts, with the gaps that they should have at most, about. The same for any number of threads.
// Throws kCancelled. O(length of all rims), some 5 us a spacing.
void narrowGaps(const SplatPoints& points, const PointIndex& index,
                const std::vector<ChosenSplat>& chosen, std::vector<Splat>& splats,
                ThreadPool& pool, const CancelFlag& cancel);

}  // namespace stipple
