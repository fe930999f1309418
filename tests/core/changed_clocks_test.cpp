// SPDX-License-Identifier: BSD-3-Clause
#include "support/changed_clocks.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <vector>

#include "core/fake_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"

// Changes of the machine's clocks while a robot runs.

namespace trifinger::test {
namespace {

constexpr Nanoseconds kMillisecond = std::chrono::milliseconds(1);
constexpr std::chrono::hours kDay(24);

class ChangedClocksTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!clocks_.work()) GTEST_SKIP() << "the library does not ask our clock_gettime";
  }

  ChangedClocks clocks_;
  // The back-end runs in real time, by the machine's clock, however busy the machine is.
  FakeDriver driver_;
  SessionHost host_ = SessionHost::anonymous({.history = 4096, .queue = 64});
  Backend backend_{driver_,
                   host_,
                   {.mode = BackendOptions::Mode::kRealTime,
                    .period = kMillisecond,
                    .max_action_repeats = 1'000'000'000,
                    .max_skipped_ticks = 1'000'000'000,
                    .first_action_timeout = std::chrono::hours(1)}};
  BackendThread thread_{backend_};
};

TEST_F(ChangedClocksTest, fault_55_OnTheWallChangeNothing) {
  Frontend<FakeRobot> robot(host_);
  clocks_.set_wall_ahead(kDay);  // far longer than the first action may take
  robot.append_desired_action({});
  constexpr TimeIndex kSteps = 300;
  for (TimeIndex t = 0; t < kSteps; ++t) {
    robot.wait_until_time_index(t);
    // The clock moves an hour forward and two back: NTP, an operator, the end of summer time.
    clocks_.set_wall_ahead((t % 3 - 1) * std::chrono::hours(1));
  }
  EXPECT_FALSE(robot.fault().has_value());
  std::vector<Status> statuses(kSteps - 1);
  robot.get_statuses(0, statuses);
  const Status& first = statuses.front();
  for (const Status& status : statuses) {
    EXPECT_EQ(status.time - status.lateness,
              first.time - first.lateness + status.tick * kMillisecond.count());
    EXPECT_GE(status.lateness, 0);
    EXPECT_LT(status.lateness, kMillisecond.count());
  }
  clocks_.set_wall_ahead(-kDay);
  EXPECT_THROW(static_cast<void>(robot.get_status(1LL << 40U, std::chrono::milliseconds(5))),
               TimedOut);
  EXPECT_FALSE(robot.fault().has_value());
}

TEST_F(ChangedClocksTest, fault_55_ThatShowASuspensionEndTheSession) {
  Frontend<FakeRobot> robot(host_);
  robot.append_desired_action({});
  robot.wait_until_time_index(10);
  clocks_.set_suspended(std::chrono::seconds(5));
  std::optional<Fault> fault;
  try {
    robot.wait_until_time_index(1LL << 40U);
  } catch (const RobotStopped& stopped) {
    fault = stopped.fault();
  }
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->code, Fault::Code::kMachineSuspended);
  EXPECT_NEAR(fault->detail, 5000, 2);
  EXPECT_GE(fault->time_index, 10);
}

}  // namespace
}  // namespace trifinger::test
