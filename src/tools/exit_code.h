// SPDX-License-Identifier: Apache-2.0
// What `stipple` returns to the shell; scripts rely on these numbers (docs/cli.md).
#pragma once

#include <core/error.h>

namespace stipple {

enum class ExitCode : int {
    kDone = 0,
    kFailed = 1,         // while running: no memory, no room on the disk
    kUsage = 2,          // the command line makes no sense
    kInput = 3,          // an input file is unreadable or invalid
    kDiffer = 4,         // compare: pictures differ by more than was allowed
    kNotComparable = 5,  // compare: the pictures differ in size
    kInterrupted = 6,    // SIGINT or SIGTERM
};

ExitCode exitCodeOf(ErrorCode code);

}  // namespace stipple
