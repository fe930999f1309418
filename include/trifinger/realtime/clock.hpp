// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/time.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// Where the back-end gets its time from.
class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  [[nodiscard]] virtual Instant now() const noexcept TRIFINGER_REALTIME = 0;
  /// Returns at `deadline` or later.
  virtual void sleep_until(Instant deadline) noexcept = 0;
  /// For how long the machine has been suspended, since any instant in the past: a suspended
  /// machine does not count as time of this clock.
  [[nodiscard]] virtual Nanoseconds suspended_time() const noexcept TRIFINGER_REALTIME = 0;
};

/// The monotonic clock of the machine.
class MonotonicClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override;
  void sleep_until(Instant deadline) noexcept override;
  [[nodiscard]] Nanoseconds suspended_time() const noexcept override;

  /// One for everybody: it has no state.
  [[nodiscard]] static MonotonicClock& instance() noexcept;
};

/// A clock that stands still until it is told to go on: it drives tests of time, also across
/// fork().
class ManualClock final : public Clock {
 public:
  /// Begins at `start`.
  explicit ManualClock(Instant start = Instant(std::chrono::seconds(1000)));
  ~ManualClock() override;

  [[nodiscard]] Instant now() const noexcept override;
  void sleep_until(Instant deadline) noexcept override;
  [[nodiscard]] Nanoseconds suspended_time() const noexcept override;

  /// As if the machine were suspended for `time`, which this clock does not notice.
  void suspend(Nanoseconds time);
  /// Lets `step` pass at once: a sleeper whose deadline lies within it wakes late, as on a machine
  /// that stalls.
  void advance(Nanoseconds step);
  /// Waits until somebody sleeps on this clock with a deadline in the future, so all that was due
  /// is done.
  /// @throws TimedOut
  void wait_for_sleeper(Timeout timeout = std::chrono::seconds(60));
  /// `count` periods, one after the other, each with all that is due in it.
  void tick(Nanoseconds period, int count = 1);
  /// From now on every sleep ends at once, its deadline having come. For the end of a test.
  void run_free();

 private:
  struct State;
  State* state_;  // in memory shared with forked children
};

}  // namespace trifinger
