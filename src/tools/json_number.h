// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>

namespace stipple {

// A count that may be larger than any integer (10^14 triangles and more), as an integer where a
// double is exact.
inline nlohmann::json jsonCount(double count) {
    constexpr double kExact = 9007199254740992.0;  // 2^53
    return count < kExact ? nlohmann::json(uint64_t(count)) : nlohmann::json(count);
}

}  // namespace stipple
