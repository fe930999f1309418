// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>

namespace trifinger {

/// Counts the steps of one session. Step 0 begins with the first action.
using TimeIndex = std::int64_t;

using Nanoseconds = std::chrono::nanoseconds;

/// An instant of the monotonic clock [ns], the same in every process of one machine.
using Instant = std::chrono::time_point<std::chrono::steady_clock, Nanoseconds>;

/// How long a call may wait. Zero looks without waiting; `kForever` waits until the answer is
/// certain.
using Timeout = Nanoseconds;
inline constexpr Timeout kForever = Timeout::max();

/// The instant at which a `Timeout` that starts now runs out.
class Deadline {
 public:
  explicit Deadline(Timeout timeout) noexcept
      : end_(timeout == kForever ? Instant::max() : saturated_end(timeout)) {}

  [[nodiscard]] bool passed() const noexcept {
    return end_ != Instant::max() && std::chrono::steady_clock::now() >= end_;
  }

  /// The time left, at least zero, at most `slice`.
  [[nodiscard]] Nanoseconds remaining(Nanoseconds slice) const noexcept {
    if (end_ == Instant::max()) return slice;
    return std::clamp(Nanoseconds(end_ - std::chrono::steady_clock::now()), Nanoseconds::zero(),
                      slice);
  }

 private:
  static Instant saturated_end(Timeout timeout) noexcept {
    const Instant now = std::chrono::steady_clock::now();
    return timeout >= Instant::max() - now ? Instant::max() : now + timeout;
  }

  Instant end_;
};

/// The duration in words: "850 ns", "12 µs", "1.28 ms", "2 s". With a decimal point it has at most
/// three digits.
[[nodiscard]] std::string duration_text(Nanoseconds duration);

}  // namespace trifinger
