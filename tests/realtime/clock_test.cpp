// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/clock.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>
#include <vector>

#include "support/child_process.hpp"
#include "support/shared_value.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(MonotonicClock, NeverGoesBack) {
  const MonotonicClock clock;
  Instant last = clock.now();
  for (int i = 0; i < 10'000; ++i) {
    const Instant now = clock.now();
    ASSERT_GE(now, last);
    last = now;
  }
}

TEST(MonotonicClock, NeverWakesEarly) {
  MonotonicClock clock;
  for (const Nanoseconds wait :
       {Nanoseconds(1), Nanoseconds(microseconds(50)), Nanoseconds(milliseconds(2))}) {
    const Instant deadline = clock.now() + wait;
    clock.sleep_until(deadline);
    EXPECT_GE(clock.now(), deadline);
  }
}

TEST(MonotonicClock, DoesNotSleepUntilThePast) {
  MonotonicClock clock;
  clock.sleep_until(clock.now() - hours(1));
  clock.sleep_until(Instant());
}

TEST(MonotonicClock, IsTheClockOfEveryWait) {
  const Instant before = std::chrono::steady_clock::now();
  const Instant now = MonotonicClock::instance().now();
  EXPECT_LE(before, now);
  EXPECT_LE(now, std::chrono::steady_clock::now());
}

TEST(ManualClock, StandsStill) {
  const Instant start = Instant(hours(3));
  const ManualClock clock(start);
  EXPECT_EQ(clock.now(), start);
  EXPECT_EQ(clock.now(), start);
}

TEST(ManualClock, AdvancesByWhatItIsTold) {
  ManualClock clock;
  const Instant start = clock.now();
  clock.advance(milliseconds(7));
  clock.advance(Nanoseconds(1));
  EXPECT_EQ(clock.now(), start + milliseconds(7) + Nanoseconds(1));
}

TEST(ManualClock, DoesNotHoldBackASleeperWhoseTimeHasCome) {
  ManualClock clock;
  clock.sleep_until(clock.now());
  clock.sleep_until(clock.now() - hours(1));
}

TEST(ManualClock, LetsEveryPeriodDoItsWorkBeforeTheNext) {
  ManualClock clock;
  const Instant start = clock.now();
  std::vector<Instant> wakes;
  std::thread sleeper([&] {
    for (int i = 1; i <= 100; ++i) {
      clock.sleep_until(start + i * milliseconds(1));
      wakes.push_back(clock.now());
    }
    clock.sleep_until(start + hours(1));
  });
  clock.tick(milliseconds(1), 100);
  // The sleeper sleeps again, so everything that it wrote is visible here.
  EXPECT_EQ(wakes.size(), 100U);
  for (std::size_t i = 0; i < wakes.size(); ++i) {
    EXPECT_EQ(wakes[i], start + static_cast<int>(i + 1) * milliseconds(1));
  }
  clock.run_free();
  sleeper.join();
}

TEST(ManualClock, WakesASleeperLateWhenTimePassesAtOnce) {
  ManualClock clock;
  const Instant start = clock.now();
  Instant woken;
  std::thread sleeper([&] {
    clock.sleep_until(start + milliseconds(1));
    woken = clock.now();
  });
  clock.wait_for_sleeper();
  clock.advance(milliseconds(9));
  sleeper.join();
  EXPECT_EQ(woken, start + milliseconds(9));
}

TEST(ManualClock, RunsFreeFromDeadlineToDeadline) {
  ManualClock clock;
  clock.run_free();
  const Instant deadline = clock.now() + hours(5);
  clock.sleep_until(deadline);
  EXPECT_EQ(clock.now(), deadline);
}

TEST(ManualClock, SaysWhenNobodySleeps) {
  ManualClock clock;
  EXPECT_THROW(clock.wait_for_sleeper(milliseconds(1)), TimedOut);
}

TEST(ManualClock, DrivesAForkedChild) {
  ManualClock clock;
  const Instant start = clock.now();
  test::SharedValue<int> wakes;
  test::ChildProcess child([&] {
    for (int i = 1; i <= 50; ++i) {
      clock.sleep_until(start + i * milliseconds(1));
      *wakes = i;
    }
    clock.sleep_until(start + hours(1));
    return 0;
  });
  for (int i = 1; i <= 50; ++i) {
    clock.tick(milliseconds(1));
    ASSERT_EQ(*wakes, i);
  }
  clock.run_free();
  EXPECT_EQ(child.wait(), 0);
}

}  // namespace
}  // namespace trifinger
