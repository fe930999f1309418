// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>

#include "trifinger/base/time.hpp"

namespace trifinger::can {

// The kernel stamps messages with the wall clock, which may be set at any time. So a stamp is first
// made an age: the wall-clock time that has passed since. The age is then subtracted from the
// monotonic time. If the wall clock was set meanwhile, the age is wrong. Its error is bounded,
// because a message that is read now did not wait when the socket was last found empty.
//
// Time stamps of the hardware (SO_TIMESTAMPING) would be more exact by some microseconds, but each
// adapter has its own clock, and not all have one.

// One instant on both clocks.
struct ClockPair {
  Instant monotonic;
  Nanoseconds wall;

  [[nodiscard]] static ClockPair now() noexcept {
    // The wall clock is read last. If the thread is interrupted in between, messages seem older,
    // not newer than they are.
    const Instant monotonic = std::chrono::steady_clock::now();
    return {.monotonic = monotonic, .wall = std::chrono::system_clock::now().time_since_epoch()};
  }
};

// When a message arrived that has the stamp `stamp`. `empty` is when the socket was last found
// empty.
[[nodiscard]] constexpr Instant arrival_time(Nanoseconds stamp, const ClockPair& now,
                                             Instant empty) noexcept {
  return std::clamp(now.monotonic - (now.wall - stamp), empty, now.monotonic);
}

}  // namespace trifinger::can
