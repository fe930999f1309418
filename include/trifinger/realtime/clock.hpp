// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/time.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// The clock of the back-end.
class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  [[nodiscard]] virtual Instant now() const noexcept TRIFINGER_REALTIME = 0;
  /// Returns at `deadline` or later.
  virtual void sleep_until(Instant deadline) noexcept = 0;
  /// The total time for which the machine has been suspended, counted from any fixed instant in the
  /// past. This clock does not count that time.
  [[nodiscard]] virtual Nanoseconds suspended_time() const noexcept TRIFINGER_REALTIME = 0;
};

/// The monotonic clock of the machine.
class MonotonicClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override;
  void sleep_until(Instant deadline) noexcept override;
  [[nodiscard]] Nanoseconds suspended_time() const noexcept override;

  /// One instance serves everybody: the clock has no state.
  [[nodiscard]] static MonotonicClock& instance() noexcept;
};

/// A clock that moves only when it is told to. Tests of time use it, also across fork().
class ManualClock final : public Clock {
 public:
  /// The clock begins at `start`.
  explicit ManualClock(Instant start = Instant(std::chrono::seconds(1000)));
  ~ManualClock() override;

  [[nodiscard]] Instant now() const noexcept override;
  void sleep_until(Instant deadline) noexcept override;
  [[nodiscard]] Nanoseconds suspended_time() const noexcept override;

  /// Pretends that the machine was suspended for `time`. This clock's own time does not change.
  void suspend(Nanoseconds time);
  /// Lets `step` pass at once. A sleeper whose deadline lies within it wakes late, like on a
  /// machine that stalls.
  void advance(Nanoseconds step);
  /// Waits until somebody sleeps on this clock with a deadline in the future. Everything that was
  /// due is then done.
  /// @throws TimedOut
  void wait_for_sleeper(Timeout timeout = std::chrono::seconds(60));
  /// Lets `count` periods pass, one after the other, and waits until all work due in each is done.
  void tick(Nanoseconds period, int count = 1);
  /// From now on every sleep ends at once, as if its deadline had come. For the end of a test.
  void run_free();

 private:
  struct State;
  State* state_;  // in memory shared with forked children
};

}  // namespace trifinger
