// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/timing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <random>
#include <utility>
#include <vector>

#include "trifinger/core/fault.hpp"

namespace trifinger {
namespace {

constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);
using Histogram = LatenessHistogram;

// Returns times of all magnitudes, and those around each bound.
std::vector<Nanoseconds> times_of_all_magnitudes() {
  std::vector<Nanoseconds> times;
  times.reserve(30'000);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> magnitude(0.0, 11.0);
  for (int i = 0; i < 20'000; ++i) {
    times.emplace_back(static_cast<std::int64_t>(std::pow(10.0, magnitude(random))));
  }
  for (std::size_t bin = 0; bin < Histogram::kNumBins; ++bin) {
    const Nanoseconds begin = Histogram::begin_of(bin);
    for (const int offset : {-1, 0, 1}) times.push_back(begin + Nanoseconds(offset));
  }
  return times;
}

TEST(LatenessHistogram, PutsEveryTimeBetweenTheBoundsOfItsBin) {
  for (const Nanoseconds time : times_of_all_magnitudes()) {
    const std::size_t bin = Histogram::bin_of(time);
    ASSERT_LT(bin, Histogram::kNumBins);
    EXPECT_LE(Histogram::begin_of(bin), std::max(time, Nanoseconds(0)));
    EXPECT_LT(time, Histogram::end_of(bin));
  }
}

TEST(LatenessHistogram, HasBinsWithoutGapsThatAreAnEighthOfTheirTimesWide) {
  EXPECT_EQ(Histogram::begin_of(0), Nanoseconds::zero());
  EXPECT_EQ(Histogram::begin_of(Histogram::kNumBins - 1), Histogram::kLongest);
  for (std::size_t bin = 0; bin + 1 < Histogram::kNumBins; ++bin) {
    const Nanoseconds begin = Histogram::begin_of(bin);
    EXPECT_EQ(Histogram::end_of(bin), Histogram::begin_of(bin + 1));
    EXPECT_LE(Histogram::end_of(bin) - begin, std::max(begin / 8, Histogram::kFinest)) << bin;
  }
}

TEST(LatenessHistogram, TakesTimesBeforeTheDeadlineForInTimeAndTheLongestForLong) {
  EXPECT_EQ(Histogram::bin_of(Nanoseconds(-5)), 0U);
  EXPECT_EQ(Histogram::bin_of(Nanoseconds::max()), Histogram::kNumBins - 1);
}

TEST(LatenessHistogram, LosesNoTime) {
  const std::vector<Nanoseconds> times = times_of_all_magnitudes();
  Histogram histogram;
  for (const Nanoseconds time : times) histogram.add(time);
  std::uint64_t sum = 0;
  for (std::size_t bin = 0; bin < Histogram::kNumBins; ++bin) sum += histogram.count_in(bin);
  EXPECT_EQ(sum, times.size());
  EXPECT_EQ(histogram.count(), times.size());
  EXPECT_EQ(histogram.max(), std::ranges::max(times));
}

TEST(LatenessHistogram, KnowsQuantilesToTheWidthOfTheirBin) {
  std::vector<Nanoseconds> times = times_of_all_magnitudes();
  Histogram histogram;
  for (const Nanoseconds time : times) histogram.add(time);
  std::ranges::sort(times);
  for (const double fraction : {0.001, 0.01, 0.25, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank =
        static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(times.size()))) - 1;
    const std::size_t bin = Histogram::bin_of(times[rank]);
    EXPECT_GE(histogram.quantile(fraction), Histogram::begin_of(bin)) << fraction;
    EXPECT_LE(histogram.quantile(fraction), Histogram::end_of(bin)) << fraction;
  }
  EXPECT_EQ(histogram.quantile(1.0), times.back());
}

TEST(LatenessHistogram, HasQuantilesThatGrowWithTheirShare) {
  Histogram histogram;
  for (const Nanoseconds time : times_of_all_magnitudes()) histogram.add(time);
  Nanoseconds before{0};
  for (int percent = 0; percent <= 100; ++percent) {
    const Nanoseconds quantile = histogram.quantile(percent / 100.0);
    EXPECT_GE(quantile, before);
    before = quantile;
  }
}

TEST(LatenessHistogram, IsZeroWithoutTimes) {
  EXPECT_EQ(Histogram().count(), 0U);
  EXPECT_EQ(Histogram().quantile(0.5), Nanoseconds::zero());
}

Status in_time() { return {.lateness = 1000}; }
Status late(Status::Flag flag, Nanoseconds lateness = std::chrono::microseconds(700)) {
  return {.lateness = lateness.count(), .flags = flag};
}
Status repeated(std::uint32_t repeats) {
  return {.flags = Status::kActionRepeated, .action_repeats = repeats};
}

TEST(LateCause, IsWhoTheStatusBlames) {
  EXPECT_EQ(late_cause(in_time()), LateCause::kNone);
  EXPECT_EQ(late_cause(repeated(1)), LateCause::kUser);
  EXPECT_EQ(late_cause(late(Status::kSchedulerLate)), LateCause::kScheduler);
  EXPECT_EQ(late_cause(late(Status::kDriverLate)), LateCause::kDriver);
  Status last{.flags = Status::kEnd};
  EXPECT_EQ(late_cause(last), LateCause::kNone);
  last.fault_code = static_cast<std::int32_t>(Fault::Code::kActionLate);
  EXPECT_EQ(late_cause(last), LateCause::kUser);
}

TEST(LateCause, IsNotTheUserWhileTheBackendIsLateItself) {
  Status status = repeated(1);
  status.flags |= Status::kSchedulerLate;
  EXPECT_EQ(late_cause(status), LateCause::kScheduler);
}

TEST(TimingRecord, CountsEveryStepOnceAndByItsCause) {
  std::mt19937 random(2);
  TimingRecord record;
  std::array<std::uint64_t, 4> expected{};
  constexpr TimeIndex kSteps = 5000;
  for (TimeIndex t = 0; t < kSteps; ++t) {
    const std::array<Status, 4> kinds{in_time(), repeated(1), late(Status::kSchedulerLate),
                                      late(Status::kDriverLate)};
    const std::size_t kind = random() % kinds.size();
    ++expected[kind];
    record.add(t, kinds[kind], kPeriod);
  }
  EXPECT_EQ(record.steps(), static_cast<std::uint64_t>(kSteps));
  EXPECT_EQ(record.lateness().count(), record.steps());
  EXPECT_EQ(record.late_steps(LateCause::kUser), expected[1]);
  EXPECT_EQ(record.late_steps(LateCause::kScheduler), expected[2]);
  EXPECT_EQ(record.late_steps(LateCause::kDriver), expected[3]);
  EXPECT_EQ(record.late_steps() + record.late_steps(LateCause::kNone), record.steps());
}

TEST(TimingRecord, RatesTheNewestThousandSteps) {
  std::mt19937 random(3);
  TimingRecord record;
  EXPECT_EQ(record.success_rate(), 1.0);
  std::deque<bool> newest;
  for (TimeIndex t = 0; t < 4000; ++t) {
    // The steps get later and later, then they are in time again.
    const bool is_late = t < 2500 && std::cmp_less(random() % 2500, t);
    record.add(t, is_late ? repeated(1) : in_time(), kPeriod);
    newest.push_back(is_late);
    if (newest.size() > TimingRecord::kRecentSteps) newest.pop_front();
    const auto good = static_cast<double>(std::ranges::count(newest, false));
    ASSERT_NEAR(record.success_rate(), good / static_cast<double>(newest.size()), 1e-12) << t;
  }
  EXPECT_EQ(record.success_rate(), 1.0);
}

TEST(TimingRecord, CountsTheTicksLeftOutInTheLateness) {
  TimingRecord record;
  Status status = late(Status::kSchedulerLate, std::chrono::microseconds(300));
  status.skipped_ticks = 4;
  record.add(0, status, kPeriod);
  EXPECT_EQ(record.lateness().max(), std::chrono::microseconds(4300));
  EXPECT_EQ(record.worst().front().lateness, std::chrono::microseconds(4300));
}

TEST(TimingRecord, KeepsTheWorstSteps) {
  std::mt19937 random(4);
  TimingRecord record;
  std::vector<std::int64_t> all;
  EXPECT_TRUE(record.worst().empty());
  for (TimeIndex t = 0; t < 1000; t += 2) {  // every other step, so that no two touch
    const Nanoseconds lateness(500'000 + static_cast<std::int64_t>(random() % 10'000'000));
    all.push_back(lateness.count());
    record.add(t, late(Status::kDriverLate, lateness), kPeriod);
  }
  std::ranges::sort(all, std::ranges::greater());
  ASSERT_EQ(record.worst().size(), TimingRecord::kNumWorst);
  for (std::size_t i = 0; i < TimingRecord::kNumWorst; ++i) {
    EXPECT_EQ(record.worst()[i].lateness.count(), all[i]);
    EXPECT_EQ(record.worst()[i].cause, LateCause::kDriver);
  }
}

TEST(TimingRecord, TakesAUserWhoIsLaterAndLaterForOneCase) {
  TimingRecord record;
  record.add(9, late(Status::kSchedulerLate), kPeriod);
  for (std::uint32_t i = 1; i <= 100; ++i) record.add(9 + i, repeated(i), kPeriod);
  Status last{.flags = Status::kEnd,
              .action_repeats = 100,
              .fault_code = static_cast<std::int32_t>(Fault::Code::kActionLate)};
  record.add(110, last, kPeriod);
  ASSERT_EQ(record.worst().size(), 2U);
  EXPECT_EQ(record.worst()[0].time_index, 110);
  EXPECT_EQ(record.worst()[0].lateness, 101 * kPeriod);
  EXPECT_EQ(record.worst()[0].cause, LateCause::kUser);
  EXPECT_EQ(record.worst()[1].time_index, 9);
}

TEST(TimingRecord, IsToldInOneClause) {
  TimingRecord record;
  for (TimeIndex t = 0; t < 10'000; ++t) {
    const bool is_late = t == 50 || t == 77 || t == 9000;
    record.add(t,
               is_late ? late(Status::kDriverLate, std::chrono::microseconds(600 + t)) : in_time(),
               kPeriod);
  }
  record.add(10'000, repeated(1), kPeriod);
  EXPECT_EQ(describe(record),
            "4 of 10001 steps were late (user 1, driver 3), the worst by 9.6 ms at step 9000");
  EXPECT_EQ(describe(TimingRecord()), "0 of 0 steps were late");
}

}  // namespace
}  // namespace trifinger
