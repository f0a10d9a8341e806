// SPDX-License-Identifier: Apache-2.0
// Options of builders as --set gives them: texts, with what is allowed in the error.
#pragma once

#include <core/error.h>

#include <charconv>
#include <string>

namespace stipple {

[[noreturn]] inline void refuseOption(const std::string& key, const std::string& value,
                                      const std::string& allowed) {
    throw Error(ErrorCode::kInvalidArgument, "--set",
                "'" + value + "' is not a value of " + key + " (" + allowed + ")");
}

// allowed: low and high as the error shows them, "8..2048".
inline double numberOption(const std::string& key, const std::string& value, double low,
                           double high, const char* allowed) {
    double v = 0.0;
    const char* end = value.data() + value.size();
    const auto [rest, error] = std::from_chars(value.data(), end, v);
    if (error != std::errc() || rest != end || !(v >= low && v <= high))
        refuseOption(key, value, allowed);
    return v;
}

inline bool switchOption(const std::string& key, const std::string& value) {
    if (value != "on" && value != "off") refuseOption(key, value, "on|off");
    return value == "on";
}

}  // namespace stipple
