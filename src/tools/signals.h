// SPDX-License-Identifier: Apache-2.0
// SIGINT and SIGTERM as a CancelFlag.
#pragma once

#include <core/parallel.h>

namespace stipple {

// Installs handlers, once, and returns the flag they raise. A second signal of the same kind ends
// the process at once.
const CancelFlag& cancelOnSignals();

// Throws Error(kCancelled) if the flag is raised.
void throwIfCancelled(const CancelFlag& cancel);

}  // namespace stipple
