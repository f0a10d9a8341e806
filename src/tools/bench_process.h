// SPDX-License-Identifier: Apache-2.0
// The program as a process of its own: what a first picture costs, and the memory of one method
// alone.
#pragma once

#include <tools/bench.h>

namespace stipple {

// Runs `stipple render` with all of `settings` for the camera of that name and reads its --stats.
// Ends the process if cancelled. Throws kCancelled, kInternal if the process fails, kIo.
ColdStart runColdStart(const BenchOptions& options, const std::string& camera,
                       const RenderSettings& settings, const CancelFlag& cancel);

}  // namespace stipple
