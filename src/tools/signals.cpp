// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <tools/signals.h>

#include <csignal>

namespace stipple {

namespace {

// A signal handler can only reach what is global.
CancelFlag raised_by_signal;
static_assert(std::atomic<bool>::is_always_lock_free, "signal handlers must not wait for a lock");

void raiseFlag(int) { raised_by_signal.requested.store(true); }

}  // namespace

const CancelFlag& cancelOnSignals() {
    struct sigaction action = {};
    action.sa_handler = raiseFlag;
    action.sa_flags = SA_RESTART | int(SA_RESETHAND);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    return raised_by_signal;
}

void throwIfCancelled(const CancelFlag& cancel) {
    if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "interrupted");
}

}  // namespace stipple
