// SPDX-License-Identifier: Apache-2.0
// Scene files that `stipple generate` writes: rules only, a few kilobytes whatever they stand for.
#pragma once

#include <cstdint>
#include <string>

namespace stipple {

struct GeneratedSceneParams {
    uint64_t count = 0;  // instances, about
    uint64_t seed = 1;
    double size = 0.0;  // metres along a side; 0: as the count asks for
};

// Mixed wood on hilly ground, one scatter rule. The scene stores every instance: count up to 10^8.
std::string forestSceneJson(const GeneratedSceneParams& params);

// Woods, clearings and meadows: patches of 200 m, in blocks, in regions, in a landscape. Memory
// hardly grows with the count, up to 10^13. The size follows from the count.
std::string landscapeSceneJson(const GeneratedSceneParams& params);

}  // namespace stipple
