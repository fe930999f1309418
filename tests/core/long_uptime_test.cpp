// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/drivers_of_tests.hpp"
#include "core/named_robot.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"

// A robot that has run for ages: indices in requests and answers have any size.

namespace trifinger::test {
namespace {

using Traits = FakeDriverTraits;
using ::testing::HasSubstr;

// Number of bits that the indices exceed during the test.
class LongUptime : public ::testing::TestWithParam<int> {
 protected:
  static constexpr TimeIndex kSteps = 200;

  [[nodiscard]] static TimeIndex first() { return (TimeIndex{1} << GetParam()) - kSteps / 2; }
  [[nodiscard]] static Plan plan(Plan other = {}) {
    other.first_index = first();
    return other;
  }
};

TEST_P(LongUptime, fault_71_LosesAndKeepsTheHistoryThatItShould) {
  AcrossProcesses::Rig<Traits> rig(plan({.session = {.history = 64, .queue = 16}}));
  auto robot = rig.connect();
  EXPECT_EQ(robot.current_time_index(), first() - 1);
  static_cast<void>(robot.latest_observation());
  for (TimeIndex k = 0; k < kSteps; ++k) {
    ASSERT_EQ(robot.append_desired_action(Traits::action(k)), first() + k);
  }
  robot.wait_until_time_index(first() + kSteps);
  const auto [oldest, end] = UntypedFrontend(robot.session()).range(Series::kAppliedAction);
  EXPECT_EQ(oldest, end - 64);
  EXPECT_EQ(end, first() + kSteps);
  EXPECT_EQ(robot.get_desired_action(end - 1).setpoint, Traits::action(kSteps - 1).setpoint);
  try {
    static_cast<void>(robot.get_desired_action(first()));
    FAIL() << "the step is still there";
  } catch (const HistoryLost& lost) {
    EXPECT_EQ(lost.oldest(), oldest);
  }
  EXPECT_THAT(message_of<InvalidArgument>([&] { return robot.get_desired_action(first() - 1); }),
              HasSubstr("steps begin at " + std::to_string(first())));
  EXPECT_EQ(robot.session().info().steps, kSteps);
  robot.finish();
  EXPECT_EQ(robot.fault(), (Fault{.code = Fault::Code::kFinished, .time_index = end}));
}

TEST_P(LongUptime, fault_71_RepeatsLateActionsAndNamesTheStepOfAFault) {
  AcrossProcesses::Rig<Traits> rig(plan(with_deadlines(2)));
  auto robot = rig.connect();
  rig.tick();
  for (TimeIndex k = 0; k < kSteps / 2; ++k) {
    ASSERT_EQ(robot.append_desired_action(Traits::action(k)), first() + k);
    rig.tick();
  }
  rig.tick(2);
  EXPECT_TRUE(has_flag(robot, first() + kSteps / 2, Status::kActionRepeated));
  ASSERT_EQ(robot.append_desired_action({}), first() + kSteps / 2 + 2);
  rig.tick(4);
  rig.last_tick();
  const TimeIndex end = first() + kSteps / 2 + 5;
  EXPECT_THAT(message_of<RobotStopped>([&] { return robot.append_desired_action({}); }),
              HasSubstr("the action for step " + std::to_string(end)));
  EXPECT_EQ(robot.fault(),
            (Fault{.code = Fault::Code::kActionLate, .detail = 2, .time_index = end}));
  EXPECT_EQ(robot.get_status(end - 1).tick, kSteps / 2 + 4);
}

TEST_P(LongUptime, fault_71_EndsBeforeItsFirstStepAsAnyOther) {
  AcrossProcesses::Rig<Traits> rig(plan());
  const auto robot = rig.observe();
  static_cast<void>(robot.latest_observation());
  rig.kill();
  EXPECT_EQ(robot.fault(), (Fault{.code = Fault::Code::kBackendDied}));
  EXPECT_EQ(robot.session().info().steps, 0);
}

INSTANTIATE_TEST_SUITE_P(Bits, LongUptime, ::testing::Values(31, 32, 53));

}  // namespace
}  // namespace trifinger::test
