// SPDX-License-Identifier: Apache-2.0
// What else the machine did while something was measured.
#pragma once

namespace stipple {

// Since some moment, seconds of all processors together: what there was, what was used, and what
// this program used. Zeros where the system does not say.
struct ProcessorTime {
    double there = 0.0, used = 0.0, own = 0.0;
};
ProcessorTime processorTime();

// Of the processors, what other programs took between the two; 0 if too short a time to tell.
double othersShare(const ProcessorTime& before, const ProcessorTime& after);

}  // namespace stipple
