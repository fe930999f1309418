// SPDX-License-Identifier: BSD-3-Clause
#include "servos/servo_robot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "dynamixel/control_table.hpp"
#include "servos/rig.hpp"
#include "support/message_of.hpp"
#include "trifinger/joint/reasons.hpp"

namespace trifinger::servos::test {
namespace {

namespace registers = dynamixel::registers;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using trifinger::test::message_of;

RigOptions position_mode() {
  RigOptions options{.robot = claw_options()};
  options.robot.mode = ServoMode::kPosition;
  return options;
}

TEST(ServoRobot, HasTheElementsOfARobotWithThatManyJoints) {
  const Rig rig;
  EXPECT_EQ(rig.robot.description().action.text(), describe_robot<Claw>().action.text());
  EXPECT_EQ(rig.robot.description().observation.text(), describe_robot<Claw>().observation.text());
  EXPECT_EQ(rig.robot.description().applied_action.text(),
            describe_robot<Claw>().applied_action.text());
}

TEST(ServoRobot, SetsUpItsMotorsAndIsReadyWhereSessionsBegin) {
  Rig rig;
  rig.begin();
  EXPECT_EQ(rig.steps, 1);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_EQ(rig.value(i, registers::kTorqueEnable), 1) << i;
    EXPECT_EQ(rig.value(i, registers::kOperatingMode), 0) << i;
    EXPECT_EQ(rig.value(i, registers::kReturnDelay), 0) << i;
  }
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(rig.observation.position[i], rig.options.robot.initial_position[i], 2e-3) << i;
  }
}

TEST(ServoRobot, SendsTorquesAsCurrentsOfTheDirectionOfItsMotors) {
  Rig rig;
  rig.begin();
  Claw::Action action;
  action.torque = {0.26, 0, 0, 0, 0.26, 0, 0, 0, -0.13};
  ASSERT_TRUE(rig.step(action));
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  // 1.3 Nm/A, and 2.69 mA for each step of the register.
  EXPECT_EQ(rig.value(0, registers::kGoalCurrent), 74);
  EXPECT_EQ(rig.value(1, registers::kGoalCurrent), 0);
  EXPECT_EQ(rig.value(4, registers::kGoalCurrent), -74);  // turns the other way
  EXPECT_EQ(rig.value(8, registers::kGoalCurrent), -37);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(rig.step(action));
  EXPECT_GT(rig.observation.velocity[0], 0.05);
  EXPECT_GT(rig.observation.velocity[4], 0.05);
  EXPECT_LT(rig.observation.velocity[8], -0.05);
  EXPECT_NEAR(rig.observation.torque[0], 0.26, 0.01);
  EXPECT_NEAR(rig.observation.torque[4], 0.26, 0.01);
}

TEST(ServoRobot, FollowsPositionsWithTheSafetyChain) {
  Rig rig;
  rig.begin();
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(rig.step(to_position(0.4))) << rig.fault();
  for (const double position : rig.observation.position) EXPECT_NEAR(position, 0.4, 0.02);
  // Beyond the soft limit.
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(rig.step(to_position(5.0))) << rig.fault();
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(rig.observation.position[i], 1.2, 0.02);
    EXPECT_TRUE(has(rig.applied.reasons[i], Reason::kTargetClamped));
  }
}

TEST(ServoRobot, SaysInTheAppliedActionWhatTheLargestCurrentAllows) {
  RigOptions options{.robot = claw_options()};
  options.robot.max_current = 0.1;
  Rig rig(options);
  rig.begin();
  Claw::Action action;
  action.torque[0] = 2.0;
  ASSERT_TRUE(rig.step(action));
  EXPECT_DOUBLE_EQ(rig.applied.torque[0], 0.13);
  EXPECT_TRUE(has(rig.applied.reasons[0], Reason::kTorqueClipped));
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  EXPECT_EQ(rig.value(0, registers::kGoalCurrent), 37);
}

TEST(ServoRobot, KnowsHowOldItsMeasurementsAre) {
  Rig rig;
  rig.begin();
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(rig.step(to_position(0.1)));
    // Two cycles of the bus take a little more than a step.
    EXPECT_GT(rig.last.measurement_age, -1);
    const DriverReport report = rig.observe();
    EXPECT_GT(report.measurement_age, 0);
    EXPECT_LT(report.measurement_age, Nanoseconds(1500us).count());
    EXPECT_EQ(report.lost_frames, 0U);
  }
}

// Its own rate: D'Claw's motors at 4 Mbaud, from the bytes of all packets.
TEST(ServoRobot, ReadsNineMotorsAtTheRateOfTheirBus) {
  struct Case {
    bool is_fast;
    double cycles;  // per second
  };
  for (const Case& expected : {Case{false, 1476.0}, Case{true, 1852.0}}) {
    RigOptions options{.robot = claw_options()};
    options.group.is_fast = expected.is_fast;
    Rig rig(options);
    rig.begin();
    const Instant begin = rig.motors.now();
    const std::uint64_t cycles = rig.robot.motors().cycles;
    for (int i = 0; i < 2000; ++i) ASSERT_TRUE(rig.step(to_position(0.1 * std::sin(0.01 * i))));
    const double seconds = std::chrono::duration<double>(rig.motors.now() - begin).count();
    const double rate = static_cast<double>(rig.robot.motors().cycles - cycles) / seconds;
    EXPECT_NEAR(rate, expected.cycles, 0.1 * expected.cycles) << expected.is_fast;
    RecordProperty(expected.is_fast ? "fast" : "classic", std::to_string(rate));
  }
}

TEST(ServoRobot, ShowsJointsThatSensorsMeasure) {
  RigOptions options{.robot = claw_options()};
  const std::array<JointKind, kJoints> kinds{};
  const std::vector<FieldDescription> more{{.name = "joint_position",
                                            .type = ScalarType::kFloat64,
                                            .shape = {3},
                                            .unit = "rad",
                                            .offset = 0},
                                           {.name = "joint_velocity",
                                            .type = ScalarType::kFloat64,
                                            .shape = {3},
                                            .unit = "rad/s",
                                            .offset = 0}};
  options.robot.types = describe_counted("claw", kinds, more);
  options.robot.sensors = {{.id = 50, .direction = -1.0, .ratio = 1.0, .zero = 0.5}};
  options.robot.all_joints = {std::nullopt, 9, 1};  // unknown, the sensor, the second joint
  Rig rig(options);
  rig.motors.plant.set_position(kJoints, 0.2);
  rig.begin();
  struct {
    Claw::Observation usual;
    JointVector<3> joint_position;
    JointVector<3> joint_velocity;
  } observation{};
  ASSERT_EQ(rig.robot.description().observation.size(), sizeof(observation));
  ASSERT_EQ(rig.robot.get_latest_observation(&observation).state, DriverReport::State::kReady);
  EXPECT_TRUE(std::isnan(observation.joint_position[0]));
  EXPECT_NEAR(observation.joint_position[1], 0.3, 2e-3);
  EXPECT_EQ(observation.joint_position[2], observation.usual.position[1]);
  EXPECT_TRUE(std::isnan(observation.joint_velocity[0]));
  // A sensor has no torque, whatever happens.
  EXPECT_EQ(rig.value(kJoints, registers::kTorqueEnable), 0);
}

TEST(ServoRobot, CarriesItsWeightWhileItHolds) {
  RigOptions options{.robot = claw_options()};
  options.robot.weight = [](std::span<const double> position, std::span<double> torque) {
    for (std::size_t i = 0; i < torque.size(); ++i) torque[i] = 0.1 * position[i];
  };
  Rig rig(options);
  rig.begin();
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  Claw::Action hold;
  ASSERT_EQ(rig.robot.hold(&rig.observation, &hold).state, DriverReport::State::kReady);
  EXPECT_NEAR(hold.torque[1], -0.1, 1e-3);
  EXPECT_EQ(hold.position[1], rig.observation.position[1]);
}

TEST(ServoRobot, DampsAfterASessionAndLetsGo) {
  RigOptions options{.robot = claw_options()};
  options.robot.stop.damping_time = 20ms;
  Rig rig(options);
  rig.begin();
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(rig.step(to_position(0.3)));
  for (TimeIndex step = 0; step < 20; ++step) {
    EXPECT_EQ(rig.robot.stop(step).state, DriverReport::State::kBusy);
    EXPECT_EQ(rig.value(0, registers::kTorqueEnable), 1);
    static_cast<void>(rig.observe());
  }
  EXPECT_EQ(rig.robot.stop(20).state, DriverReport::State::kReady);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_EQ(rig.value(i, registers::kTorqueEnable), 0) << i;
  }
}

// ---- motors that follow positions ----

TEST(ServoRobotInPositionMode, FollowsPositionsNotFasterThanItMay) {
  RigOptions options = position_mode();
  for (JointLimit& limit : options.robot.limits) limit.max_velocity = 1.0;
  Rig rig(options);
  rig.begin();
  EXPECT_EQ(rig.value(0, registers::kOperatingMode), 5);
  double fastest = 0.0;
  for (int i = 0; i < 3000; ++i) {
    ASSERT_TRUE(rig.step(to_position(0.4))) << rig.fault();
    if (i == 0) {
      EXPECT_TRUE(has(rig.applied.reasons[1], Reason::kTooFast));
      EXPECT_NEAR(rig.applied.position[1], rig.observation.position[1] + 1e-3, 1e-6);
    }
    EXPECT_EQ(rig.applied.torque[0], 0.0);
    fastest = std::max(fastest, std::abs(rig.observation.velocity[1]));
  }
  for (const double position : rig.observation.position) EXPECT_NEAR(position, 0.4, 0.02);
  EXPECT_LT(fastest, 1.5);
}

TEST(ServoRobotInPositionMode, RefusesTorquesAndGainsByName) {
  Rig rig(position_mode());
  rig.begin();
  for (int i = 0; i < 500; ++i) ASSERT_TRUE(rig.step(to_position(0.2)));

  Claw::Action action = to_position(0.9);
  action.torque[4] = 0.3;
  ASSERT_TRUE(rig.step(action));
  EXPECT_TRUE(rig.last.action_rejected);
  EXPECT_THAT(std::string(rig.robot.rejection_text()),
              HasSubstr("torque of joint 4 (J21) is 0.3, but its motor follows positions"));
  // This joint holds its last position; the others obey.
  EXPECT_NEAR(rig.applied.position[4], 0.2, 1e-9);

  action = to_position(0.2);
  action.position_kp[2] = 1.0;
  ASSERT_TRUE(rig.step(action));
  EXPECT_TRUE(rig.last.action_rejected);
  EXPECT_THAT(std::string(rig.robot.rejection_text()), HasSubstr("position_kp of joint 2 (J12)"));

  // The robot's own gains do not count as given.
  action.position_kp[2] = 2.0;
  action.position_kd[2] = 0.02;
  ASSERT_TRUE(rig.step(action));
  EXPECT_FALSE(rig.last.action_rejected);
}

TEST(ServoRobotInPositionMode, HoldsItsLastGoalWithoutAPosition) {
  Rig rig(position_mode());
  rig.begin();
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(rig.step(to_position(0.2)));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(rig.step(Claw::Action{}));
  EXPECT_FALSE(rig.last.action_rejected);
  for (const double position : rig.observation.position) EXPECT_NEAR(position, 0.2, 0.02);
}

TEST(ServoRobotInPositionMode, HoldsWithoutTorques) {
  RigOptions options = position_mode();
  options.robot.weight = [](std::span<const double>, std::span<double> torque) {
    std::ranges::fill(torque, 0.1);
  };
  Rig rig(options);
  rig.begin();
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  Claw::Action hold;
  ASSERT_EQ(rig.robot.hold(&rig.observation, &hold).state, DriverReport::State::kReady);
  ASSERT_TRUE(rig.step(hold));
  EXPECT_FALSE(rig.last.action_rejected);
}

// ---- settings ----

TEST(ServoRobotOptions, AreRefusedByName) {
  const auto message = [](auto change) {
    ServoRobotOptions options = claw_options();
    change(options);
    return message_of<InvalidArgument>([&] { options.validate(); });
  };
  EXPECT_THAT(message([](auto& o) { o.motors.pop_back(); }),
              HasSubstr("there are 8 motors for 9 joints"));
  EXPECT_THAT(message([](auto& o) { o.motors[1].direction = 0.5; }),
              HasSubstr("direction of J11 is 0.5, must be 1 or -1"));
  EXPECT_THAT(message([](auto& o) { o.motors[2].ratio = 0.0; }), HasSubstr("ratio of J12 is 0"));
  // Joints between -1.4 and 1.4 rad; three of the motors have a zero of -1.5 rad.
  EXPECT_THAT(message([](auto& o) { o.motors[1].ratio = 3.0; }),
              AllOf(HasSubstr("the motor of J11 is at -4.2 rad where the joint is at -1.4"),
                    HasSubstr("knows its angle within one turn only")));
  EXPECT_THAT(message([](auto& o) { o.motors[0].zero = 1.8; }),
              HasSubstr("the motor of J10 is at 3.2 rad where the joint is at 1.4"));
  EXPECT_EQ(message([](auto& o) { o.motors[1].ratio = 2.2; }), "nothing");
  EXPECT_THAT(message([](auto& o) { o.initial_position[3] = 1.3; }),
              HasSubstr("J20 begins at 1.3, its soft limits are -1.2 and 1.2"));
  EXPECT_THAT(message([](auto& o) { o.motors[3].torque_constant = std::nan(""); }),
              HasSubstr("torque_constant of J20"));
  EXPECT_THAT(message([](auto& o) { o.max_current = 0.0; }), HasSubstr("max_current is 0 A"));
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_THAT(message([](auto& o) { o.max_current = kInfinity; }),
              HasSubstr("max_current is inf A, must be above 0 and at most 20, or infinite in the "
                        "mode position"));
  EXPECT_EQ(message([](auto& o) {
              o.mode = ServoMode::kPosition;
              o.max_current = kInfinity;
            }),
            "nothing");
  EXPECT_THAT(message([](auto& o) { o.reset.untangle = {{0, 2.0}}; }),
              HasSubstr("reset.untangle of J10 is 2"));
  EXPECT_THAT(message([](auto& o) { o.all_joints = {12}; }), HasSubstr("not there"));
}

TEST(ServoRobotOptions, HaveSensorsWhoseJointsAreKnownAfterTheyAreSwitchedOn) {
  const auto message = [](double ratio, std::optional<std::array<double, 2>> range) {
    ServoRobotOptions options = claw_options();
    options.sensors = {{.id = 50, .ratio = ratio, .zero = 0.1}};
    options.sensor_ranges = {range};
    return message_of<InvalidArgument>([&] { options.validate(); });
  };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(message(1.0, std::nullopt), "nothing");
  EXPECT_EQ(message(1.0, {{-kInfinity, kInfinity}}), "nothing");
  EXPECT_EQ(message(0.5, std::nullopt), "nothing");
  EXPECT_EQ(message(3.0, {{-1.0, 1.0}}), "nothing");
  EXPECT_THAT(message(3.0, {{-1.0, 1.1}}), HasSubstr("the motor of sensor 50 is at 3.4 rad"));
  EXPECT_THAT(message(3.0, std::nullopt), HasSubstr("the motor of sensor 50 is at -inf rad"));
  EXPECT_THAT(message(0.4, std::nullopt), HasSubstr("the motor of sensor 50"));
}

TEST(Servo, TurnsAnglesAndTorquesBothWays) {
  constexpr Servo kServo{.id = 1, .direction = -1.0, .ratio = 4.0, .zero = 0.5};
  EXPECT_DOUBLE_EQ(kServo.motor_position(0.3), -0.7);
  EXPECT_DOUBLE_EQ(kServo.joint_position(-0.7), 0.3);
  EXPECT_DOUBLE_EQ(kServo.joint_velocity(2.0), -0.5);
  EXPECT_DOUBLE_EQ(kServo.motor_torque(2.0), -0.5);
  EXPECT_DOUBLE_EQ(kServo.joint_torque(-0.5), 2.0);
}

}  // namespace
}  // namespace trifinger::servos::test
