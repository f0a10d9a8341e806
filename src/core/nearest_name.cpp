// SPDX-License-Identifier: Apache-2.0
#include <core/nearest_name.h>

#include <algorithm>
#include <numeric>

namespace stipple {

namespace {

// Insertions, deletions and replacements that turn `a` into `b`.
size_t editDistance(const std::string& a, const std::string& b) {
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t(0));
    for (size_t i = 1; i <= a.size(); ++i) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= b.size(); ++j) {
            const size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

}  // namespace

std::string nearestName(const std::string& name, const std::vector<std::string>& candidates) {
    constexpr size_t kLongestName = 256;  // names come from strangers; keep the cost bounded
    if (name.size() > kLongestName) return "";
    std::string best;
    size_t best_distance = kLongestName;
    for (const std::string& candidate : candidates) {
        const size_t longer = std::max(name.size(), candidate.size());
        if (longer > kLongestName) continue;
        const size_t distance = editDistance(name, candidate);
        if (distance < best_distance && 5 * distance <= 2 * longer) {
            best = candidate;
            best_distance = distance;
        }
    }
    return best;
}

}  // namespace stipple
