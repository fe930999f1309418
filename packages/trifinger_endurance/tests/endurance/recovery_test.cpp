// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/recovery.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

using namespace std::chrono_literals;

TEST(Recovery, TriesWithGrowingPausesAndThenAsksForAnOperator) {
  Recovery recovery({.attempts = 6, .first_pause = 1s, .longest_pause = 10s});
  Nanoseconds now = 0s;
  Nanoseconds last = 0s;
  for (int i = 0; i < 6; ++i) {
    const auto decision = recovery.after(Failure::kStuck, "joint 3 is stuck", now);
    ASSERT_FALSE(decision.needs_operator);
    EXPECT_EQ(decision.pause, std::min<Nanoseconds>(1s * (1 << i), 10s));
    EXPECT_GE(decision.pause, last);
    last = decision.pause;
    now += decision.pause;
  }
  const auto decision = recovery.after(Failure::kStuck, "joint 3 is stuck", now);
  EXPECT_TRUE(decision.needs_operator);
  EXPECT_NE(decision.why.find("joint 3 is stuck"), std::string::npos);
  EXPECT_NE(decision.why.find("encoder"), std::string::npos) << decision.why;
}

TEST(Recovery, BeginsAnewOnceTheRobotWasWell) {
  Recovery recovery({.attempts = 2, .most_per_hour = 1e6});
  for (int i = 0; i < 1000; ++i) {
    EXPECT_FALSE(recovery.after(Failure::kDriver, "", 1s * i).needs_operator);
    EXPECT_FALSE(recovery.after(Failure::kDriver, "", 1s * i).needs_operator);
    recovery.is_well();
  }
}

TEST(Recovery, AsksForAnOperatorIfFailuresAreTooFrequentThoughEachIsRecovered) {
  // One every five minutes is 12 in an hour.
  Recovery patient({.most_per_hour = 13});
  Recovery strict({.most_per_hour = 11});
  bool has_asked = false;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_FALSE(patient.after(Failure::kHardLimit, "", 5min * i).needs_operator) << i;
    patient.is_well();
    has_asked = has_asked || strict.after(Failure::kHardLimit, "", 5min * i).needs_operator;
    strict.is_well();
  }
  EXPECT_TRUE(has_asked);
}

TEST(Recovery, WaitsForARobotThatNobodyRunsAsLongAsItsTimeout) {
  Recovery recovery({.attempts = 1, .timeout = 10min, .most_per_hour = 1});
  EXPECT_FALSE(recovery.after(Failure::kBackendDied, "", 0s).needs_operator);
  for (Nanoseconds now = 1s; now <= 10min; now += 1s) {
    ASSERT_FALSE(recovery.after(Failure::kAbsent, "", now).needs_operator);
  }
  const auto decision = recovery.after(Failure::kAbsent, "there is no robot", 10min + 2s);
  EXPECT_TRUE(decision.needs_operator);
  EXPECT_NE(decision.why.find("trifinger run"), std::string::npos) << decision.why;
}

TEST(Recovery, AsksAtOnceIfAnotherRobotHasTheName) {
  Recovery recovery({});
  EXPECT_TRUE(recovery.after(Failure::kOtherRobot, "", 0s).needs_operator);
}

TEST(Recovery, RefusesOptionsThatMakeNoSense) {
  EXPECT_THROW(Recovery({.attempts = 0}), InvalidArgument);
  EXPECT_THROW(Recovery({.first_pause = 2min}), InvalidArgument);
  EXPECT_THROW(Recovery({.most_per_hour = 0.0}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::apps
