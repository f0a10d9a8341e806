// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <tools/frame_names.h>

#include <cctype>
#include <cstdio>

namespace stipple {

namespace {

// Reads "%d", "%4d" or "%04d" at `at` and moves behind it; false for anything else.
bool readPlace(const std::string& pattern, size_t& at, bool& zeros, int& width) {
    size_t i = at + 1;
    zeros = i < pattern.size() && pattern[i] == '0';
    if (zeros) ++i;
    width = 0;
    if (i < pattern.size() && std::isdigit(static_cast<unsigned char>(pattern[i])))
        width = pattern[i++] - '0';
    if (i >= pattern.size() || pattern[i] != 'd') return false;
    at = i + 1;
    return true;
}

}  // namespace

std::string frameName(const std::string& option, const std::string& pattern, int number) {
    std::string name;
    int places = 0;
    for (size_t i = 0; i < pattern.size();) {
        if (pattern[i] != '%') {
            name += pattern[i++];
        } else if (pattern.compare(i, 2, "%%") == 0) {
            name += '%';
            i += 2;
        } else {
            bool zeros = false;
            int width = 0;
            if (!readPlace(pattern, i, zeros, width)) {
                throw Error(ErrorCode::kInvalidArgument, option,
                            "'" + pattern + "' has a % that is neither %d, as %04d, nor %%");
            }
            char text[32];
            std::snprintf(text, sizeof text, zeros ? "%0*d" : "%*d", width, number);
            name += text;
            ++places;
        }
    }
    if (places != 1) {
        throw Error(
            ErrorCode::kInvalidArgument, option,
            "'" + pattern + "' needs one place for the pictures' numbers, as in out_%04d.png");
    }
    return name;
}

}  // namespace stipple
