// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>

#include "support/allocation_counter.hpp"
#include "support/message_of.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/sim/simulation.hpp"

// What a simulated robot says about the end of a session.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;

// Returns the text that a user gets who appends `action` until the session has ended.
template <class R>
std::string end_of(const Simulation& simulation, const typename R::Action& action) {
  auto robot = simulation.connect<R>();
  return message_of<RobotStopped>([&] {
    while (true) static_cast<void>(robot.get_status(robot.append_desired_action(action)));
  });
}

TEST(Rejection, fault_06_SaysWhichFieldOfWhichJointWasNotFitAndWhatIsAllowed) {
  const Simulation simulation;
  TriFinger::Action action;
  std::ranges::copy(simulation.robot().initial_position(), action.position.begin());
  action.position_kd[4] = 1.0;
  EXPECT_EQ(end_of<TriFinger>(simulation, action),
            "robot 'trifinger-edu' has stopped: 11 actions in a row up to step 11 were not fit to "
            "apply; the last: position_kd of joint 4 (finger_upper_to_middle_joint_120) is 1, "
            "allowed are 0 to 0.5 (max_kd)");
}

TEST(Rejection, fault_06_NamesTheJointsOfASingleFingerToo) {
  SimulationOptions options;
  options.description = {.variant = Variant::kPro, .arrangement = Arrangement::kSingleFinger};
  Finger::Action action;
  action.torque[0] = kNotGiven;
  EXPECT_EQ(end_of<Finger>(Simulation(options, {}, {}, "left"), action),
            "robot 'left' has stopped: 11 actions in a row up to step 11 were not fit to apply; "
            "the last: torque of joint 0 (finger_base_to_upper_joint) is nan, allowed are "
            "finite numbers");
}

TEST(Rejection, fault_06_TakesNoMemory) {
  SimulatedRobot robot;
  TriFinger::Action action;
  action.torque.fill(kNotGiven);
  TriFinger::Observation observation;
  TriFinger::AppliedAction applied;
  const TriFinger::Action nothing;
  ASSERT_EQ(robot.get_latest_observation(&observation).state, DriverReport::State::kReady);
  static_cast<void>(robot.apply_action(&nothing, &applied));
  const AllocationCounter allocations;
  const DriverReport report = robot.apply_action(&action, &applied);
  const std::string_view text = robot.rejection_text();
  EXPECT_EQ(allocations.count(), 0U);
  EXPECT_TRUE(report.action_rejected);
  EXPECT_THAT(std::string(text), HasSubstr("8 more values were not fit"));
}

TEST(OwnCheck, SeesWhatItsRobotMeasuresAndChangesWhatIsApplied) {
  const Simulation simulation;
  simulation.robot().add_check<TriFinger>(
      [](const TriFinger::Observation& y, TriFinger::Action& action) {
        action.torque[2] = 0.1 * y.position[1];
      });
  auto robot = simulation.connect();
  const TimeIndex t = robot.append_desired_action({});
  EXPECT_EQ(robot.get_applied_action(t).torque[2], 0.1 * robot.get_observation(t).position[1]);
  EXPECT_EQ(message_of<InvalidArgument>(
                [&] { simulation.robot().add_check<Finger>([](const auto&, auto&) {}); }),
            "a check for robots of type 'finger' cannot check one of type 'trifinger'");
}

TEST(OwnCheck, fault_16_EndsTheSessionWithTheTextOfWhatItThrew) {
  const Simulation simulation;
  int calls = 0;
  simulation.robot().add_check<TriFinger>([&](const auto&, auto&) {
    if (++calls == 3) throw std::runtime_error("too near to the table");
  });
  EXPECT_EQ(end_of<TriFinger>(simulation, {}),
            "robot 'trifinger-edu' has stopped: the driver gave up at step 2: a safety check threw "
            "an exception: too near to the table");
}

TEST(OwnCheck, fault_63_ThatIsInterruptedEndsTheSessionWithoutAFault) {
  const Simulation simulation;
  bool is_interrupted = true;
  simulation.robot().add_check<TriFinger>([&](const auto&, auto&) {
    if (is_interrupted) throw Interrupted("Ctrl-C");
  });
  EXPECT_THAT(end_of<TriFinger>(simulation, {}), HasSubstr("let go at step 0 without finish()"));
  // There is nothing to recover.
  is_interrupted = false;
  auto robot = simulation.connect();
  static_cast<void>(robot.get_status(robot.append_desired_action({})));
}

}  // namespace
}  // namespace trifinger::test
