// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "trifinger/base/time.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger {

/// Who caused a late step.
enum class LateCause : std::uint32_t {
  kNone,       ///< The step was in time.
  kUser,       ///< Its action was missing.
  kScheduler,  ///< The back-end was woken late, or did not get the processor.
  kDriver,     ///< Calls of the driver used up the tick before.
};
[[nodiscard]] std::string_view name_of(LateCause cause) noexcept;

/// Who caused the step of `status` to be late. If the back-end itself is late, the user is not
/// blamed.
[[nodiscard]] LateCause late_cause(const Status& status) noexcept;

/// How late the step of `status` was: the time from the deadline to the beginning of the tick. If
/// ticks were left out before it, the time counts from the deadline of the first of them. Zero
/// without deadlines. Everything that is shown as "lateness" is this value; `TimingRecord` keeps
/// its quantiles and its maximum.
[[nodiscard]] Nanoseconds lateness_of(const Status& status, Nanoseconds period) noexcept;

/// Counts times in bins whose width grows with the time: eight bins for each power of two. A
/// quantile is therefore known to an eighth of its value, however many times were counted.
class LatenessHistogram {
 public:
  /// Width of the first eight bins, in which the shortest times are counted.
  static constexpr Nanoseconds kFinest{128};
  /// All times from here on [about 2 s] are in the last bin.
  static constexpr Nanoseconds kLongest{std::int64_t{1} << 31U};
  static constexpr std::size_t kNumBins = 177;

  /// The bin of `time`; negative times belong to the first bin.
  [[nodiscard]] static std::size_t bin_of(Nanoseconds time) noexcept;
  /// The shortest time in `bin`.
  [[nodiscard]] static Nanoseconds begin_of(std::size_t bin) noexcept;
  /// The first time after the end of `bin`; kForever for the last bin.
  [[nodiscard]] static Nanoseconds end_of(std::size_t bin) noexcept;

  void add(Nanoseconds time) noexcept;

  /// Number of counted times.
  [[nodiscard]] std::uint64_t count() const noexcept;
  /// Number of times in `bin`.
  [[nodiscard]] std::uint64_t count_in(std::size_t bin) const noexcept { return counts_[bin]; }
  /// The time below which the share `fraction` of all times lies; zero if no time was counted.
  [[nodiscard]] Nanoseconds quantile(double fraction) const noexcept;
  /// The longest time.
  [[nodiscard]] Nanoseconds max() const noexcept { return max_; }

 private:
  std::array<std::uint64_t, kNumBins> counts_{};
  Nanoseconds max_{0};
};

/// A step that was late.
struct LateStep {
  TimeIndex time_index{-1};
  /// How late the tick began. If the user caused it, the time without a new action.
  Nanoseconds lateness{0};
  LateCause cause{LateCause::kNone};  ///< Who caused it.
};

/// How well a session in real time keeps its time: a summary of all its statuses, including the
/// last one. It is plain data of a fixed size. The back-end keeps one for everybody to read, and a
/// log gives the same.
class TimingRecord {
 public:
  static constexpr std::size_t kNumWorst = 5;
  /// `success_rate` is a share of this number of the newest steps.
  static constexpr std::uint64_t kRecentSteps = 1000;

  /// Adds the status of step `t`. Steps must be added in order.
  void add(TimeIndex t, const Status& status, Nanoseconds period) noexcept;

  /// The `lateness_of` all steps.
  [[nodiscard]] const LatenessHistogram& lateness() const noexcept { return lateness_; }
  /// Number of steps so far, including the one that ended the session.
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  /// Number of late steps: all of them, or those late because of `cause`.
  [[nodiscard]] std::uint64_t late_steps() const noexcept;
  [[nodiscard]] std::uint64_t late_steps(LateCause cause) const noexcept;
  /// The share of the newest 1000 steps that were in time: 1 if all of them were.
  [[nodiscard]] double success_rate() const noexcept;
  /// The worst late steps, the worst one first. In a row of steps with growing lateness only the
  /// last one is listed.
  [[nodiscard]] std::span<const LateStep> worst() const noexcept;

 private:
  static constexpr std::size_t kNumCauses = 4;

  void note_recent(bool is_late) noexcept;
  void note_worst(const LateStep& step) noexcept;

  LatenessHistogram lateness_;
  std::uint64_t steps_{0};
  std::array<std::uint64_t, kNumCauses> counts_{};  // number of steps by cause
  std::uint64_t recent_late_{0};
  std::array<std::uint64_t, (kRecentSteps + 63) / 64> recent_{};  // one bit per step: late
  std::array<LateStep, kNumWorst> worst_{};
};

/// For example "p50 12 µs, p99 80 µs, max 1.2 ms".
[[nodiscard]] std::string describe(const LatenessHistogram& lateness);

/// For example "3 of 10000 steps were late (user 3), the worst by 1.2 ms at step 77".
[[nodiscard]] std::string describe(const TimingRecord& timing);

}  // namespace trifinger
