// SPDX-License-Identifier: Apache-2.0
#include <tools/progress.h>

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace stipple {

namespace {

constexpr auto kRedrawInterval = std::chrono::milliseconds(100);
constexpr int kBarWidth = 30;
constexpr char kClearLine[] = "\r\x1b[K";

}  // namespace

Progress::Progress(bool quiet)
    : style_(quiet                   ? Style::kNone
             : isatty(STDERR_FILENO) ? Style::kBar
                                     : Style::kLines) {}

Progress::~Progress() {
    if (style_ == Style::kBar && !phase_.empty()) std::fputs(kClearLine, stderr);
}

void Progress::update(const std::string& phase, double fraction) {
    if (style_ == Style::kNone) return;
    const Clock::time_point now = Clock::now();
    if (phase != phase_) {
        finish();
        phase_ = phase;
        phase_start_ = now;
        next_draw_ = now;
    }
    if (style_ != Style::kBar || now < next_draw_) return;
    next_draw_ = now + kRedrawInterval;
    drawBar(std::clamp(fraction, 0.0, 1.0),
            std::chrono::duration<double>(now - phase_start_).count());
}

void Progress::finish() {
    if (phase_.empty()) return;
    const double seconds = std::chrono::duration<double>(Clock::now() - phase_start_).count();
    if (style_ == Style::kBar) std::fputs(kClearLine, stderr);
    if (style_ == Style::kLines) std::fprintf(stderr, "%s: %.2f s\n", phase_.c_str(), seconds);
    phase_.clear();
}

void Progress::drawBar(double fraction, double seconds) {
    const int filled = int(fraction * kBarWidth);
    std::fprintf(stderr, "%s%-12s [%s%s] %3d %%", kClearLine, phase_.c_str(),
                 std::string(filled, '#').c_str(), std::string(kBarWidth - filled, ' ').c_str(),
                 int(fraction * 100));
    // A guess from the first percents, or the first moments, would only jump about.
    if (fraction > 0.02 && seconds > 0.5) {
        std::fprintf(stderr, "  %.0f s left", seconds / fraction * (1.0 - fraction));
    }
    std::fflush(stderr);
}

}  // namespace stipple
