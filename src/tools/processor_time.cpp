// SPDX-License-Identifier: Apache-2.0
#include <tools/processor_time.h>

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace stipple {

namespace {

constexpr double kShortest = 0.2;  // the system counts in hundredths of a second

double secondsOf(const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); }

}  // namespace

ProcessorTime processorTime() {
    ProcessorTime time;
    std::ifstream file("/proc/stat");
    std::string name;
    // user, nice, system, idle, waiting, interrupts (hard, soft), stolen by other machines
    double ticks[8];
    if (!(file >> name) || name != "cpu") return time;
    for (double& t : ticks) {
        if (!(file >> t)) return time;
        time.there += t;
    }
    const double per_second = double(sysconf(_SC_CLK_TCK));
    time.used = (time.there - ticks[3] - ticks[4]) / per_second;
    time.there /= per_second;
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    time.own = secondsOf(usage.ru_utime) + secondsOf(usage.ru_stime);
    return time;
}

double othersShare(const ProcessorTime& before, const ProcessorTime& after) {
    const double there = after.there - before.there;
    if (!(there > kShortest)) return 0.0;
    const double others = (after.used - before.used) - (after.own - before.own);
    return std::clamp(others / there, 0.0, 1.0);
}

}  // namespace stipple
