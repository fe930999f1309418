// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>

#include "core/named_robot.hpp"
#include "core/transports.hpp"
#include "support/interruptions.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/errors.hpp"

// A signal makes the kernel end a thread's wait. No wait may mistake that for what it waited for.

namespace trifinger::test {
namespace {

TEST(Interruption, fault_23_MakesNoWaitShorter) {
  const SessionFolder folder;
  const NamedRobot backend;
  auto robot = connect<FakeRobot>("robot");
  robot.append_desired_action({});
  const std::int64_t before = Interruptions::count();
  Interruptions interruptions;
  interruptions.begin();
  for (const int milliseconds : {1, 20, 250}) {  // shorter and longer than the slices of a wait
    const std::chrono::milliseconds timeout(milliseconds);
    const Instant begin = std::chrono::steady_clock::now();
    EXPECT_THROW(static_cast<void>(robot.get_observation(1000, timeout)), TimedOut);
    EXPECT_GE(std::chrono::steady_clock::now() - begin, timeout);
  }
  EXPECT_GT(Interruptions::count(), before);
}

TEST(Interruption, fault_23_MakesNoStepEarlyAndLosesNone) {
  constexpr TimeIndex kSteps = 500;
  const SessionFolder folder;
  FakeDriver driver;
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host, kTolerantDeadlines);
  const std::int64_t before = Interruptions::count();
  Interruptions interruptions;
  const BackendThread thread(backend);
  interruptions.begin();
  Frontend<FakeRobot> robot(host, {.timeout = kLong});
  ASSERT_EQ(robot.append_desired_action({}), 0);
  for (TimeIndex t = 0; t < kSteps; ++t) {
    const Status status = robot.get_status(t, kLong);
    EXPECT_GE(status.lateness, 0) << t;
    EXPECT_EQ(robot.get_observation(t).applied_actions,
              robot.get_observation(0).applied_actions + t);
  }
  EXPECT_FALSE(robot.fault().has_value());
  EXPECT_GT(Interruptions::count(), before);
}

}  // namespace
}  // namespace trifinger::test
