// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/timing.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <numeric>

#include "trifinger/base/text.hpp"
#include "trifinger/core/fault.hpp"

namespace trifinger {
namespace {

// There are eight bins for each power of two.
constexpr unsigned kBits = 3;
constexpr std::size_t kLastBin = LatenessHistogram::kNumBins - 1;

// How late the step was, for LateStep.
Nanoseconds late_by(const Status& status, LateCause cause, Nanoseconds period) noexcept {
  if (cause != LateCause::kUser) return lateness_of(status, period);
  // If the session ended because this action was missing, the action was not repeated, but counts.
  const bool is_repeated = (status.flags & Status::kActionRepeated) != 0;
  return (status.action_repeats + (is_repeated ? 0 : 1)) * period;
}

}  // namespace

std::string_view name_of(LateCause cause) noexcept {
  static constexpr std::array<std::string_view, 4> kNames{"none", "user", "scheduler", "driver"};
  return name_in(kNames, cause);
}

LateCause late_cause(const Status& status) noexcept {
  if ((status.flags & Status::kDriverLate) != 0) return LateCause::kDriver;
  if ((status.flags & Status::kSchedulerLate) != 0) return LateCause::kScheduler;
  const bool is_missing = (status.flags & Status::kActionRepeated) != 0 ||
                          status.fault_code == static_cast<std::int32_t>(Fault::Code::kActionLate);
  return is_missing ? LateCause::kUser : LateCause::kNone;
}

Nanoseconds lateness_of(const Status& status, Nanoseconds period) noexcept {
  return Nanoseconds(status.lateness) + status.skipped_ticks * period;
}

std::size_t LatenessHistogram::bin_of(Nanoseconds time) noexcept {
  if (time >= kLongest) return kLastBin;
  const auto value = static_cast<std::uint64_t>(std::max(time, Nanoseconds::zero()) / kFinest);
  if (value < (1U << kBits)) return value;
  const auto shift = static_cast<unsigned>(std::bit_width(value)) - kBits - 1;
  return (std::size_t{shift} << kBits) + (value >> shift);
}

Nanoseconds LatenessHistogram::begin_of(std::size_t bin) noexcept {
  if (bin >= kLastBin) return kLongest;
  const std::size_t shift = bin < (1U << kBits) ? 0 : (bin >> kBits) - 1;
  return static_cast<std::int64_t>((bin - (shift << kBits)) << shift) * kFinest;
}

Nanoseconds LatenessHistogram::end_of(std::size_t bin) noexcept {
  return bin >= kLastBin ? kForever : begin_of(bin + 1);
}

void LatenessHistogram::add(Nanoseconds time) noexcept {
  max_ = std::max(max_, time);
  ++counts_[bin_of(time)];
}

std::uint64_t LatenessHistogram::count() const noexcept {
  return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
}

Nanoseconds LatenessHistogram::quantile(double fraction) const noexcept {
  const double wanted = std::clamp(fraction, 0.0, 1.0) * static_cast<double>(count());
  double below = 0.0;
  for (std::size_t bin = 0; bin < kNumBins; ++bin) {
    const auto count = static_cast<double>(counts_[bin]);
    if (count > 0.0 && below + count >= wanted) {
      // The times of a bin are assumed to be spread evenly over it, but not above the largest time.
      const Nanoseconds begin = begin_of(bin);
      const Nanoseconds end = std::max(begin, std::min(end_of(bin), max_));
      return begin + std::chrono::round<Nanoseconds>((end - begin) * ((wanted - below) / count));
    }
    below += count;
  }
  return max_;
}

void TimingRecord::add(TimeIndex t, const Status& status, Nanoseconds period) noexcept {
  const LateCause cause = late_cause(status);
  lateness_.add(lateness_of(status, period));
  ++counts_[static_cast<std::size_t>(cause)];
  note_recent(cause != LateCause::kNone);
  ++steps_;
  if (cause == LateCause::kNone) return;
  note_worst({.time_index = t, .lateness = late_by(status, cause, period), .cause = cause});
}

void TimingRecord::note_recent(bool is_late) noexcept {
  const std::uint64_t place = steps_ % kRecentSteps;
  std::uint64_t& word = recent_[place / 64];
  const std::uint64_t bit = std::uint64_t{1} << (place % 64);
  if ((word & bit) != 0) --recent_late_;
  if (is_late) ++recent_late_;
  word = is_late ? word | bit : word & ~bit;
}

void TimingRecord::note_worst(const LateStep& step) noexcept {
  const auto is_continued = [&step](const LateStep& other) {
    return other.cause == step.cause && other.time_index == step.time_index - 1 &&
           other.lateness < step.lateness;
  };
  auto* const before = std::ranges::find_if(worst_, is_continued);
  LateStep& place = before != worst_.end() ? *before : worst_.back();
  if (place.lateness >= step.lateness) return;
  place = step;
  std::ranges::sort(worst_, std::ranges::greater(), &LateStep::lateness);
}

std::uint64_t TimingRecord::late_steps() const noexcept {
  return late_steps(LateCause::kUser) + late_steps(LateCause::kScheduler) +
         late_steps(LateCause::kDriver);
}

std::uint64_t TimingRecord::late_steps(LateCause cause) const noexcept {
  return counts_[static_cast<std::size_t>(cause)];
}

double TimingRecord::success_rate() const noexcept {
  const std::uint64_t recent = std::min(steps_, kRecentSteps);
  if (recent == 0) return 1.0;
  return 1.0 - static_cast<double>(recent_late_) / static_cast<double>(recent);
}

std::span<const LateStep> TimingRecord::worst() const noexcept {
  const auto* const end = std::ranges::find(worst_, LateCause::kNone, &LateStep::cause);
  return {worst_.begin(), end};
}

std::string describe(const LatenessHistogram& lateness) {
  return "p50 " + duration_text(lateness.quantile(0.5)) + ", p99 " +
         duration_text(lateness.quantile(0.99)) + ", max " + duration_text(lateness.max());
}

std::string describe(const TimingRecord& timing) {
  std::string text = std::to_string(timing.late_steps()) + " of " + std::to_string(timing.steps()) +
                     " steps were late";
  std::string causes;
  for (const LateCause cause : {LateCause::kUser, LateCause::kScheduler, LateCause::kDriver}) {
    if (timing.late_steps(cause) == 0) continue;
    causes += (causes.empty() ? "" : ", ") + std::string(name_of(cause)) + " " +
              std::to_string(timing.late_steps(cause));
  }
  if (!causes.empty()) text += " (" + causes + ")";
  if (!timing.worst().empty()) {
    const LateStep& worst = timing.worst().front();
    text += ", the worst by " + duration_text(worst.lateness) + " at step " +
            std::to_string(worst.time_index);
  }
  return text;
}

}  // namespace trifinger
