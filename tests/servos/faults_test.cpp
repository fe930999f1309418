// SPDX-License-Identifier: BSD-3-Clause
// What a robot on motors does when something goes wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include "dynamixel/control_table.hpp"
#include "dynamixel/status.hpp"
#include "servos/rig.hpp"

namespace trifinger::servos::test {
namespace {

namespace registers = dynamixel::registers;
using namespace std::chrono_literals;
using dynamixel::HardwareError;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

// Runs until the session ends, at most so many steps.
void run_to_the_end(Rig& rig, int most = 2000) {
  for (int i = 0; i < most; ++i) {
    if (!rig.step(to_position(0.1))) return;
  }
  FAIL() << "the session did not end";
}

void expect_no_torque(Rig& rig) {
  for (std::size_t i = 0; i < kJoints; ++i) {
    if (rig.motor(i).is_on()) {
      EXPECT_EQ(rig.value(i, registers::kTorqueEnable), 0) << i;
    }
    EXPECT_EQ(rig.motor(i).torque(), 0.0) << i;
  }
}

TEST(ServoFaults, AnOverloadedMotorStopsTheRobotAndIsRebooted) {
  Rig rig;
  rig.begin();
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(rig.step(to_position(0.1)));
  rig.motor(4).fail(HardwareError::kOverload);
  run_to_the_end(rig);
  EXPECT_THAT(rig.fault(),
              AllOf(StartsWith("J21: motor 21 has stopped"), HasSubstr("beyond its torque")));
  EXPECT_EQ(rig.last.fault_code, ServoRobot::kMotorFault + (5 << 8));
  static_cast<void>(rig.observe());
  expect_no_torque(rig);
  EXPECT_EQ(rig.robot.stop(0).state, DriverReport::State::kReady);
  // Someone has recovered it.
  rig.begin();
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(rig.step(to_position(0.1))) << rig.fault();
}

TEST(ServoFaults, EveryHardwareErrorIsNamed) {
  for (const HardwareError error : dynamixel::kHardwareErrors) {
    Rig rig;
    rig.begin();
    rig.motor(0).fail(error);
    run_to_the_end(rig);
    EXPECT_THAT(rig.fault(), HasSubstr(std::string(dynamixel::text_of(error).sentence)));
  }
}

TEST(ServoFaults, AMotorWithoutSupplyIsNamed) {
  Rig rig;
  rig.begin();
  rig.motor(8).set_power(false);
  run_to_the_end(rig);
  EXPECT_THAT(rig.fault(), StartsWith("J32: motor 32 does not answer any more; check its supply"));
  EXPECT_GT(rig.lost_frames, 0U);
  // It stays away.
  const DriverReport report = rig.prepare();
  EXPECT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_THAT(std::string(rig.robot.fault_text(report.fault_code)),
              HasSubstr("motor 32 does not answer at 4000000 baud"));
  rig.motor(8).set_power(true);
  rig.begin();
}

TEST(ServoFaults, AMotorThatHasRestartedIsNamed) {
  Rig rig;
  rig.begin();
  rig.motor(3).set_power(false);
  rig.motor(3).set_power(true);
  run_to_the_end(rig);
  EXPECT_THAT(rig.fault(), StartsWith("J20: motor 20 has switched its torque off"));
}

// Wherever the motors were turned to without supply: the joints are where they are.
TEST(ServoFaults, MotorsThatWereTurnedWithoutSupplyKnowTheirJoints) {
  Rig rig;
  rig.begin();
  for (std::size_t i = 0; i < kJoints; ++i) rig.motor(i).set_power(false);
  run_to_the_end(rig);
  for (std::size_t i = 0; i < kJoints; ++i) {
    const double turns = static_cast<double>(i) - 4.0;
    const double position = rig.options.robot.initial_position[i] + 0.01;
    rig.motors.plant.set_position(
        i, rig.options.robot.motors[i].motor_position(position) + 2.0 * std::numbers::pi * turns);
  }
  rig.motors.port->sleep_until(rig.motors.now() + 10ms);
  for (std::size_t i = 0; i < kJoints; ++i) rig.motor(i).set_power(true);
  rig.begin();
  ASSERT_EQ(rig.observe().state, DriverReport::State::kReady);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(rig.observation.position[i], rig.options.robot.initial_position[i] + 0.01, 2e-3);
  }
}

TEST(ServoFaults, AnUnpluggedAdapterEndsTheSessionUntilItIsPluggedInAgain) {
  Rig rig;
  rig.begin();
  rig.motors.port->set_plugged(false);
  run_to_the_end(rig);
  EXPECT_THAT(rig.fault(), StartsWith("the serial line to the motors has gone"));
  const DriverReport report = rig.prepare();
  EXPECT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_THAT(std::string(rig.robot.fault_text(report.fault_code)), HasSubstr("not plugged in"));
  rig.motors.port->set_plugged(true);
  // Its motors have stopped by themselves.
  rig.motors.port->sleep_until(rig.motors.now() + 1s);
  for (std::size_t i = 0; i < kJoints; ++i) EXPECT_EQ(rig.motor(i).torque(), 0.0) << i;
  rig.begin();
}

TEST(ServoFaults, MotorsStopWhenTheProgramIsKilled) {
  Rig rig;
  rig.begin();
  Claw::Action action;
  action.torque.fill(0.2);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(rig.step(action));
  EXPECT_NE(rig.motor(0).torque(), 0.0);
  // Nothing comes any more.
  rig.motors.port->sleep_until(rig.motors.now() + 200ms);
  for (std::size_t i = 0; i < kJoints; ++i) EXPECT_EQ(rig.motor(i).torque(), 0.0) << i;
  // If it was only stopped, it notices.
  run_to_the_end(rig);
  EXPECT_THAT(rig.fault(), HasSubstr("has stopped because it heard nothing for too long"));
}

TEST(ServoFaults, CurrentsEndWhenTheLoopGivesNoActions) {
  Rig rig;
  rig.begin();
  Claw::Action action;
  action.torque.fill(0.2);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(rig.step(action));
  EXPECT_NE(rig.value(0, registers::kGoalCurrent), 0);
  for (int i = 0; i < 60; ++i) static_cast<void>(rig.observe());
  EXPECT_EQ(rig.value(0, registers::kGoalCurrent), 0);
  ASSERT_TRUE(rig.step(action));  // It goes on.
}

// Motors that take their time: a request is carried out when the test says so.
class SlowMotors final : public dynamixel::MotorLink {
 public:
  bool read(dynamixel::MotorSnapshot& snapshot) noexcept override {
    snapshot = newest;
    return true;
  }
  void set_goals(std::span<const double> /*goals*/) noexcept override {}
  std::uint64_t request_start() noexcept override { return request(true); }
  std::uint64_t request_release() noexcept override { return request(false); }
  void cut() noexcept override {}
  [[nodiscard]] Instant now() const noexcept override { return {}; }

  dynamixel::MotorSnapshot newest{};
  std::uint64_t requests{0};
  bool is_start{false};  // what was requested last

 private:
  std::uint64_t request(bool start) {
    is_start = start;
    return ++requests;
  }
};

TEST(ServoFaults, AStopReleasesMotorsThatAreStillBeingSetUp) {
  using Phase = dynamixel::MotorSnapshot::Phase;
  auto made = std::make_unique<SlowMotors>();
  SlowMotors& motors = *made;
  ServoRobot robot(claw_options(), std::move(made));
  for (const Phase reached : {Phase::kStarting, Phase::kRunning}) {
    ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kBusy);
    motors.newest.phase = reached;
    motors.newest.request = motors.requests;
    ASSERT_TRUE(motors.is_start);
    EXPECT_EQ(robot.stop(0).state, DriverReport::State::kBusy);
    EXPECT_FALSE(motors.is_start);
    // The stop ends when the motors have been released.
    EXPECT_EQ(robot.stop(1).state, DriverReport::State::kBusy);
    motors.newest.phase = Phase::kReleased;
    motors.newest.request = motors.requests;
    EXPECT_EQ(robot.stop(2).state, DriverReport::State::kReady);
    // A stop of motors that have no torque asks for nothing.
    const std::uint64_t requests = motors.requests;
    EXPECT_EQ(robot.stop(0).state, DriverReport::State::kReady);
    EXPECT_EQ(motors.requests, requests);
  }
}

TEST(ServoFaults, AnotherThreadCutsTheTorque) {
  Rig rig;
  rig.begin();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(rig.step(to_position(0.1)));
  std::thread([&rig] { rig.robot.cut(); }).join();
  run_to_the_end(rig, 2);
  EXPECT_THAT(rig.fault(), HasSubstr("switched off because the loop hung"));
  expect_no_torque(rig);
}

TEST(ServoFaults, AJointBeyondItsHardLimitStopsTheRobot) {
  Rig rig;
  rig.begin();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(rig.step(to_position(0.1)));
  rig.motors.put(rig.options, 2, 1.45);
  run_to_the_end(rig, 5);
  EXPECT_THAT(rig.fault(), HasSubstr("(J12) is beyond its hard limit"));
  EXPECT_EQ(rig.robot.stop(0).state, DriverReport::State::kReady);
  expect_no_torque(rig);
}

struct Line {
  const char* name;
  dynamixel::LineFaults faults;
  bool is_fast;
};

class ServoLine : public testing::TestWithParam<Line> {};

// Lost, damaged and late packets cost measurements, and nothing else.
TEST_P(ServoLine, IsCountedAndSurvived) {
  RigOptions options{.robot = claw_options()};
  options.line.faults = GetParam().faults;
  options.line.faults.seed = 7;
  options.group.is_fast = GetParam().is_fast;
  options.group.silent_after = 2s;
  // A motor that has not heard for so long would stop.
  options.group.watchdog = 2s;
  options.goal_timeout = 1s;
  Rig rig(options);
  rig.begin();
  for (int i = 0; i < 3000; ++i) {
    ASSERT_TRUE(rig.step(to_position(0.3 * std::sin(0.003 * i)))) << rig.fault() << " at " << i;
  }
  EXPECT_GT(rig.lost_frames, 0U);
  EXPECT_GT(rig.robot.motors().counts.missing, 0U);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(rig.observation.position[i], 0.3 * std::sin(0.003 * 2999), 0.15) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Servos, ServoLine,
    testing::Values(Line{"Lost", {.lost = 0.02}, false}, Line{"LostFast", {.lost = 0.1}, true},
                    Line{"Damaged", {.damaged = 0.02}, false},
                    Line{"DamagedFast", {.damaged = 0.1}, true},
                    Line{"Misheard", {.misheard = 0.01}, false},
                    Line{"MisheardFast", {.misheard = 0.01}, true},
                    Line{"Late", {.late = 0.005}, true}, Line{"Unheard", {.unheard = 0.01}, false},
                    Line{"Bytes", {.byte_lost = 0.02, .byte_added = 0.02}, true}),
    [](const auto& line) { return std::string(line.param.name); });

TEST(ServoFaults, EverythingCanBeRepeatedExactly) {
  const auto run = [] {
    RigOptions options{.robot = claw_options()};
    options.line.faults = {.lost = 0.05, .damaged = 0.05, .seed = 3};
    options.group.silent_after = 1s;
    Rig rig(options);
    rig.begin();
    for (int i = 0; i < 500; ++i) EXPECT_TRUE(rig.step(to_position(0.2))) << rig.fault();
    return std::pair(rig.observation.position, rig.lost_frames);
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace trifinger::servos::test
