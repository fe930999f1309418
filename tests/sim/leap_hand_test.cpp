// SPDX-License-Identifier: BSD-3-Clause
// A LEAP hand, and robots of mixed motors, with the simulation behind emulated motors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "dynamixel/control_table.hpp"
#include "sim/robot_on_motors.hpp"
#include "support/message_of.hpp"

namespace trifinger::test {
namespace {

namespace registers = dynamixel::registers;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::size_t kJoints = 16;
using Action = JointAction<kJoints>;

struct Observation {
  JointVector<kJoints> position{};
  JointVector<kJoints> velocity{};
  JointVector<kJoints> torque{};
};

using Hand = RobotOnMotors<kJoints, Observation>;
using State = DriverReport::State;

// The three kinds of hands: the usual one, the cheaper one, and one without currents.
class LeapHand : public testing::TestWithParam<std::string_view> {
 protected:
  [[nodiscard]] bool has_current() const { return model.has_current(); }

  const dynamixel::MotorModel& model{*dynamixel::find_model(GetParam())};
  Hand hand{load("leap_hand_emulated", {"dynamixel.model=" + std::string(GetParam()),
                                        model.has_current() ? "dynamixel.max_current=0.35"
                                                            : "dynamixel.max_current=.inf"})};
};

INSTANTIATE_TEST_SUITE_P(, LeapHand, testing::Values("XC330-M288", "XL330-M288", "XL430-W250"),
                         [](const auto& tested) {
                           std::string name(tested.param);
                           std::erase(name, '-');
                           return name;
                         });

TEST_P(LeapHand, HoldsItsPose) {
  hand.begin();
  ASSERT_TRUE(hand.step(Action{}));
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_EQ(hand.robot->options().motors[i].id, i);
    EXPECT_EQ(hand.line.motor(i).model().name, GetParam());
    EXPECT_EQ(hand.line.motor(i).value(registers::kOperatingMode), has_current() ? 5 : 3);
    EXPECT_EQ(hand.line.motor(i).value(registers::kTorqueEnable), 1);
  }
  const Observation before = hand.observation;
  for (int i = 0; i < 3000; ++i) ASSERT_TRUE(hand.step(Action{})) << hand.fault();
  for (std::size_t i = 0; i < kJoints; ++i) {
    // It gives way to its weight by its gains.
    EXPECT_NEAR(hand.observation.position[i], before.position[i], 0.08) << i;
    EXPECT_EQ(std::isnan(hand.observation.torque[i]), !has_current()) << i;
  }
}

TEST_P(LeapHand, MovesEachJointAlone) {
  hand.begin();
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    JointVector<kJoints> goal{};
    goal[joint] = 0.5;
    for (int i = 0; i < 1000; ++i) {
      ASSERT_TRUE(hand.step(Action::of_position(goal))) << joint << ": " << hand.fault();
    }
    for (std::size_t i = 0; i < kJoints; ++i) {
      EXPECT_NEAR(hand.observation.position[i], goal[i], 0.08) << i << " with " << joint;
    }
  }
}

TEST_P(LeapHand, ComesFromAnyPoseToThatOfItsSessions) {
  for (std::size_t i = 0; i < kJoints; ++i) hand.plant.set_position(i, i % 2 == 0 ? 0.6 : 0.9);
  hand.begin();
  ASSERT_TRUE(hand.step(Action{}));
  for (const double position : hand.observation.position) EXPECT_NEAR(position, 0.0, 0.15);
}

TEST_P(LeapHand, StopsWhenAMotorFails) {
  for (const std::size_t motor : {std::size_t{0}, std::size_t{15}}) {
    hand.begin();
    ASSERT_TRUE(hand.step(Action{}));
    hand.line.motor(motor).fail(dynamixel::HardwareError::kOverload);
    bool is_running = true;
    for (int i = 0; i < 5000 && is_running; ++i) is_running = hand.step(Action{});
    ASSERT_EQ(hand.report.state, State::kFault);
    EXPECT_THAT(hand.fault(), HasSubstr("motor " + std::to_string(motor) + " has stopped"));
    for (TimeIndex step = 0; hand.robot->stop(step).state == State::kBusy; ++step) {
      ASSERT_LT(step, 60'000);
    }
    for (std::size_t i = 0; i < kJoints; ++i) {
      EXPECT_EQ(hand.line.motor(i).value(registers::kTorqueEnable), 0) << i;
    }
  }
}

TEST(LeapHandOnMotors, HasTheTorquesOfItsModel) {
  const auto torque_constant = [](const std::vector<std::string>& overrides) {
    return load("leap_hand_emulated", overrides).servos->robot.motors[7].torque_constant;
  };
  EXPECT_DOUBLE_EQ(torque_constant({}), 0.93 / 1.8);
  EXPECT_DOUBLE_EQ(torque_constant({"dynamixel.motors.middle_dip.model=XL330-M077"}), 0.215 / 1.47);
  EXPECT_DOUBLE_EQ(torque_constant({"dynamixel.torque_constant=0.4"}), 0.4);
}

TEST(LeapHandOnMotors, RunsWithAMotorOfAnotherModel) {
  Hand hand(load("leap_hand_emulated", {"dynamixel.motors.thumb_cmc.model=XM540-W270"}));
  EXPECT_EQ(hand.line.motor(12).model().name, "XM540-W270");
  hand.begin();
  ASSERT_TRUE(hand.step(Action{}));
}

TEST(LeapHandOnMotors, DoesNotStartWithMotorsWithoutTheCurrentsThatItAsksFor) {
  Hand hand(load("leap_hand_emulated", {"dynamixel.motors.ring_pip.model=XL430-W250"}));
  hand.prepare();
  EXPECT_EQ(hand.report.state, State::kFault);
  EXPECT_THAT(hand.fault(), HasSubstr("motor 10 (XL430-W250) neither measures nor limits"));
}

TEST(LeapHandOnMotors, RefusesAConfigurationThatMakesNoSense) {
  const auto message = [](const std::string& change) {
    return message_of<Error>([&] { (void)load("leap_hand_dynamixel", {change}); });
  };
  EXPECT_THAT(message("dynamixel.model=AX-12"),
              AllOf(HasSubstr("'AX-12', which is no known model"), HasSubstr("XC330-M288")));
  EXPECT_THAT(message("dynamixel.motors.index_dip.model=X"), HasSubstr("'X', which is no known"));
  EXPECT_THAT(message("dynamixel.mode=torque"), "nothing");
  EXPECT_THAT(message("dynamixel.max_current=21"), HasSubstr("max_current is 21 A"));
}

}  // namespace
}  // namespace trifinger::test
