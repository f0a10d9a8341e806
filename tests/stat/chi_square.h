// SPDX-License-Identifier: Apache-2.0
// Pearson's test, for the statistical tests.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace stipple {

// Critical value of chi-square at 1 % (Wilson, Hilferty).
inline double criticalValue(double degrees) {
    const double z = 2.326, a = 2.0 / (9.0 * degrees);
    return degrees * std::pow(1.0 - a + z * std::sqrt(a), 3.0);
}

inline double chiSquare(const std::vector<double>& counts, const std::vector<double>& expected) {
    double sum = 0.0;
    for (size_t i = 0; i < counts.size(); ++i)
        sum += (counts[i] - expected[i]) * (counts[i] - expected[i]) / expected[i];
    return sum;
}

}  // namespace stipple
