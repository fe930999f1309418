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

TEST(DurationText, HasTheUnitThatLeavesFewDigits) {
  const auto text = [](double seconds) {
    return duration_text(std::chrono::round<Nanoseconds>(std::chrono::duration<double>(seconds)));
  };
  EXPECT_EQ(text(0.0), "0 ns");
  EXPECT_EQ(text(999e-9), "999 ns");
  EXPECT_EQ(text(12.4e-6), "12 µs");
  EXPECT_EQ(text(999.6e-6), "1 ms");
  EXPECT_EQ(text(1.284e-3), "1.28 ms");
  EXPECT_EQ(text(0.9996), "1 s");
  EXPECT_EQ(text(2.0), "2 s");
  EXPECT_EQ(text(999.9), "1000 s");
  EXPECT_EQ(text(5400.0), "5400 s");
}

}  // namespace
}  // namespace trifinger
