// SPDX-License-Identifier: Apache-2.0
// "Did you mean ...?" for keys, options and names.
#pragma once

#include <string>
#include <vector>

namespace stipple {

// The candidate with the smallest edit distance to `name`, "" if none comes near (more than two
// fifths of the longer name would have to change). O(candidates x length^2).
std::string nearestName(const std::string& name, const std::vector<std::string>& candidates);

}  // namespace stipple
