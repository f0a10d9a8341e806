// SPDX-License-Identifier: Apache-2.0
// The files of a series of pictures, by a pattern with the place of their number.
#pragma once

#include <string>

namespace stipple {

// "out_%04d.png" with 7 is "out_0007.png"; %% stands for a percent sign. Throws kInvalidArgument
// unless the pattern holds just one number's place (%d, %Nd or %0Nd with N up to 9).
// option: "-o", for messages.
std::string frameName(const std::string& option, const std::string& pattern, int number);

}  // namespace stipple
