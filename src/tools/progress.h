// SPDX-License-Identifier: Apache-2.0
// Progress on stderr: a bar with the time left where stderr is a terminal, else one line for each
// phase that ended.
#pragma once

#include <chrono>
#include <string>

namespace stipple {

class Progress {
public:
    explicit Progress(bool quiet);
    ~Progress();  // clears an unfinished bar, so that an error message starts on its own line
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    // fraction: of this phase, 0..1. Another name than before ends the phase before. Cheap enough
    // for every tile.
    void update(const std::string& phase, double fraction);
    // Ends the phase.
    void finish();

private:
    using Clock = std::chrono::steady_clock;

    void drawBar(double fraction, double seconds);

    enum class Style { kNone, kLines, kBar };
    Style style_;
    std::string phase_;  // "" between phases
    Clock::time_point phase_start_;
    Clock::time_point next_draw_;
};

}  // namespace stipple
