// SPDX-License-Identifier: Apache-2.0
// Looks at output paths before the work, so that a long render does not end in "no such folder".
#pragma once

#include <string>
#include <vector>

namespace stipple {

// Throws kInvalidArgument if the path's extension is none of `extensions` (".png"; empty: any), kIo
// if its folder is missing or not writable, or the path names something that is not a regular file.
// option: "-o", for messages.
void checkOutputFile(const std::string& option, const std::string& path,
                     const std::vector<std::string>& extensions);

// The extension in lower case, with the dot; "" if there is none.
std::string lowerExtension(const std::string& path);

}  // namespace stipple
