// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/time.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace trifinger {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

TEST(Deadline, HasPassedAtOnceWithoutTimeout) {
  const Deadline deadline(Timeout::zero());
  EXPECT_TRUE(deadline.passed());
  EXPECT_EQ(deadline.remaining(hours(1)), Nanoseconds::zero());
}

TEST(Deadline, HasPassedLongAgoWithANegativeTimeout) {
  const Deadline deadline(hours(-1));
  EXPECT_TRUE(deadline.passed());
  EXPECT_EQ(deadline.remaining(milliseconds(1)), Nanoseconds::zero());
}

TEST(Deadline, NeverPassesWhenTheTimeoutIsForEver) {
  const Deadline deadline(kForever);
  EXPECT_FALSE(deadline.passed());
  EXPECT_EQ(deadline.remaining(milliseconds(100)), milliseconds(100));
}

TEST(Deadline, DoesNotOverflow) {
  for (const Timeout timeout :
       {kForever - Nanoseconds(1), Timeout(Timeout::max() / 2), Timeout(hours(1'000'000))}) {
    const Deadline deadline(timeout);
    EXPECT_FALSE(deadline.passed()) << timeout.count();
    EXPECT_EQ(deadline.remaining(milliseconds(100)), milliseconds(100));
  }
}

TEST(Deadline, RemainingIsNeverMoreThanTheTimeLeft) {
  const Deadline deadline(hours(1));
  EXPECT_LE(deadline.remaining(hours(2)), hours(1));
  EXPECT_GT(deadline.remaining(hours(2)), Nanoseconds::zero());
}

}  // namespace
}  // namespace trifinger
