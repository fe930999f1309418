// SPDX-License-Identifier: BSD-3-Clause
// The way to the initial position.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "dynamixel/control_table.hpp"
#include "servos/rig.hpp"

namespace trifinger::servos::test {
namespace {

namespace registers = dynamixel::registers;
using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::StartsWith;

class Reset : public testing::Test {
 protected:
  // Puts all joints away from where sessions begin.
  void entangle(Rig& rig) {
    for (std::size_t i = 0; i < kJoints; ++i) rig.motors.put(rig.options, i, 0.5);
  }
  bool has_current(Rig& rig, std::size_t joint) {
    return rig.value(joint, registers::kGoalCurrent) != 0;
  }
};

TEST_F(Reset, MovesTheFirstJointsWhileAllOthersHaveNoTorque) {
  Rig rig;
  entangle(rig);
  DriverReport report = DriverReport::busy();
  bool has_moved_first = false;
  for (TimeIndex step = 0; step < 1000; ++step) {
    report = rig.robot.prepare(step);
    ASSERT_EQ(report.state, DriverReport::State::kBusy);
    for (const std::size_t joint : {0U, 2U, 3U, 5U, 6U, 8U}) {
      ASSERT_FALSE(has_current(rig, joint)) << joint << " in step " << step;
    }
    has_moved_first = has_moved_first || has_current(rig, 1);
  }
  EXPECT_TRUE(has_moved_first);
  bool has_moved_others = false;
  TimeIndex step = 1000;
  for (; report.state == DriverReport::State::kBusy && step < 4000; ++step) {
    report = rig.robot.prepare(step);
    has_moved_others = has_moved_others || has_current(rig, 0);
  }
  EXPECT_TRUE(has_moved_others);
  ASSERT_EQ(report.state, DriverReport::State::kReady) << rig.robot.fault_text(0);
  EXPECT_GE(step, 2000);
  EXPECT_LT(step, 3000);
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(rig.observation.position[i], rig.options.robot.initial_position[i], 0.0873) << i;
  }
}

TEST_F(Reset, GoesThereInPositionModeToo) {
  RigOptions options{.robot = claw_options()};
  options.robot.mode = ServoMode::kPosition;
  Rig rig(options);
  entangle(rig);
  rig.begin();
  EXPECT_GE(rig.steps, 2000);
}

TEST_F(Reset, TriesThreeTimesToUntangleAndThenAsksAPerson) {
  Rig rig;
  entangle(rig);
  rig.motors.plant.is_blocked[4] = true;
  double least = 1.0;
  double most = 0.0;
  DriverReport report = DriverReport::busy();
  TimeIndex step = 0;
  for (; report.state == DriverReport::State::kBusy && step < 60'000; ++step) {
    report = rig.robot.prepare(step);
    // After the first attempt the first joint of each finger goes to 45 degrees, three times.
    if (step > 3000) most = std::max(most, rig.motors.plant.position(0) + 1.5);
    least = std::min(least, rig.motors.plant.position(0) + 1.5);
  }
  ASSERT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_EQ(report.fault_code, ServoRobot::kNotAtStart + (5 << 8));
  EXPECT_THAT(std::string(rig.robot.fault_text(report.fault_code)),
              testing::AllOf(StartsWith("J21 is 1.5"), HasSubstr("free the fingers by hand")));
  // 3 s for each attempt, and 1.75 s to untangle before the last three.
  EXPECT_NEAR(static_cast<double>(step), 4 * 3000 + 3 * 1750, 20);
  EXPECT_GT(most, 0.7);
  EXPECT_LT(least, 0.1);
  EXPECT_EQ(rig.value(4, registers::kTorqueEnable), 0);
  EXPECT_EQ(rig.robot.stop(0).state, DriverReport::State::kReady);

  // Someone has freed it.
  rig.motors.plant.is_blocked[4] = false;
  rig.begin();
}

TEST_F(Reset, ComesFreeInALaterAttempt) {
  Rig rig;
  entangle(rig);
  rig.motors.plant.is_blocked[4] = true;
  DriverReport report = DriverReport::busy();
  TimeIndex step = 0;
  for (; report.state == DriverReport::State::kBusy && step < 60'000; ++step) {
    if (step == 4000) rig.motors.plant.is_blocked[4] = false;
    report = rig.robot.prepare(step);
  }
  ASSERT_EQ(report.state, DriverReport::State::kReady);
  EXPECT_GT(step, 5500);
  EXPECT_LT(step, 8000);
}

TEST_F(Reset, AllGoTogetherWithoutFirstOnes) {
  RigOptions options{.robot = claw_options()};
  options.robot.reset.first.clear();
  Rig rig(options);
  entangle(rig);
  rig.begin();
  EXPECT_GE(rig.steps, 1000);
  EXPECT_LT(rig.steps, 2000);
}

TEST_F(Reset, StopsAtAFaultOfAMotor) {
  Rig rig;
  entangle(rig);
  for (TimeIndex step = 0; step < 500; ++step) {
    ASSERT_EQ(rig.robot.prepare(step).state, DriverReport::State::kBusy);
  }
  rig.motor(7).set_power(false);
  DriverReport report = DriverReport::busy();
  for (TimeIndex step = 500; report.state == DriverReport::State::kBusy && step < 1000; ++step) {
    report = rig.robot.prepare(step);
  }
  ASSERT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_THAT(std::string(rig.robot.fault_text(report.fault_code)), StartsWith("J31: motor 31"));
}

}  // namespace
}  // namespace trifinger::servos::test
