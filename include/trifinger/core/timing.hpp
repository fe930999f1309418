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

/// Who was to blame for a late step.
enum class LateCause : std::uint32_t {
  kNone,       ///< The step was in time.
  kUser,       ///< Its action was missing.
  kScheduler,  ///< The back-end was woken late, or did not get the processor.
  kDriver,     ///< Calls of the driver took up the tick before.
};
[[nodiscard]] std::string_view name_of(LateCause cause) noexcept;

/// Who was to blame for the step of `status`. A back-end that is late itself blames nobody else.
[[nodiscard]] LateCause late_cause(const Status& status) noexcept;

/// How late the step of `status` was: how long after the deadline the tick began, or after the
/// deadline of the first tick that was left out before it; zero without deadlines. This is what
/// "lateness" means wherever it is shown, and `TimingRecord` is where its quantiles and its largest
/// come from.
[[nodiscard]] Nanoseconds lateness_of(const Status& status, Nanoseconds period) noexcept;

/// Counts times in bins that widen with the time: eight for each power of two, so a quantile is
/// known to an eighth of itself however many times there are.
class LatenessHistogram {
 public:
  /// The width of the first bins; shorter times than eight of them are told apart no better.
  static constexpr Nanoseconds kFinest{128};
  /// From here on [about 2 s] all times are in the last bin.
  static constexpr Nanoseconds kLongest{std::int64_t{1} << 31U};
  static constexpr std::size_t kNumBins = 177;

  /// The bin of `time`; negative times are in the first one.
  [[nodiscard]] static std::size_t bin_of(Nanoseconds time) noexcept;
  /// The shortest time in `bin`.
  [[nodiscard]] static Nanoseconds begin_of(std::size_t bin) noexcept;
  /// The first time behind `bin`; of the last bin, kForever.
  [[nodiscard]] static Nanoseconds end_of(std::size_t bin) noexcept;

  void add(Nanoseconds time) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  [[nodiscard]] std::uint64_t count_in(std::size_t bin) const noexcept { return counts_[bin]; }
  /// The time below which the share `fraction` of all times lies; zero if there are none.
  [[nodiscard]] Nanoseconds quantile(double fraction) const noexcept;
  [[nodiscard]] Nanoseconds max() const noexcept { return max_; }

 private:
  std::array<std::uint64_t, kNumBins> counts_{};
  Nanoseconds max_{0};
};

/// A step that was late.
struct LateStep {
  TimeIndex time_index{-1};
  /// How late the tick began; if the user was to blame, for how long there has been no new action.
  Nanoseconds lateness{0};
  LateCause cause{LateCause::kNone};
};

/// How a session in real time keeps its time: a sum over its statuses, the last one included. Plain
/// data of a fixed size; the back-end keeps one for everybody to read, a log gives the same.
class TimingRecord {
 public:
  static constexpr std::size_t kNumWorst = 5;
  /// Steps of which `success_rate` is the share.
  static constexpr std::uint64_t kRecentSteps = 1000;

  /// Takes in the status of step `t`, in the order of the steps.
  void add(TimeIndex t, const Status& status, Nanoseconds period) noexcept;

  /// `lateness_of` all steps.
  [[nodiscard]] const LatenessHistogram& lateness() const noexcept { return lateness_; }
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  [[nodiscard]] std::uint64_t late_steps() const noexcept;
  [[nodiscard]] std::uint64_t late_steps(LateCause cause) const noexcept;
  /// The share of the newest steps that were in time: 1 if all of them were.
  [[nodiscard]] double success_rate() const noexcept;
  /// The worst late steps, the worst first. Of steps that are later and later in a row there is
  /// only the last one.
  [[nodiscard]] std::span<const LateStep> worst() const noexcept;

 private:
  static constexpr std::size_t kNumCauses = 4;

  void note_recent(bool is_late) noexcept;
  void note_worst(const LateStep& step) noexcept;

  LatenessHistogram lateness_;
  std::uint64_t steps_{0};
  std::array<std::uint64_t, kNumCauses> counts_{};  // of steps, by cause
  std::uint64_t recent_late_{0};
  std::array<std::uint64_t, (kRecentSteps + 63) / 64> recent_{};  // a bit each: late
  std::array<LateStep, kNumWorst> worst_{};
};

/// "p50 12 µs, p99 80 µs, max 1.2 ms"
[[nodiscard]] std::string describe(const LatenessHistogram& lateness);

/// "3 of 10000 steps were late (user 3), the worst by 1.2 ms at step 77"
[[nodiscard]] std::string describe(const TimingRecord& timing);

}  // namespace trifinger
