// SPDX-License-Identifier: BSD-3-Clause
// D'Claw's hardware path with the simulation behind emulated motors.
#include "servos/servo_robot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "dynamixel/emulator.hpp"
#include "sim/robot_on_motors.hpp"
#include "sim/servo_plant.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "support/soak.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::size_t kJoints = 9;

using Action = JointAction<kJoints>;

struct Observation {
  JointVector<kJoints> position{};
  JointVector<kJoints> velocity{};
  JointVector<kJoints> torque{};
  JointVector<kJoints + 1> joint_position{};
  JointVector<kJoints + 1> joint_velocity{};
};

using Claw = RobotOnMotors<kJoints, Observation>;

Action to_finger(const std::array<double, 3>& angles) {
  JointVector<kJoints> all{};
  for (std::size_t i = 0; i < kJoints; ++i) all[i] = angles[i % 3];
  return Action::of_position(all);
}

TEST(DClawOnMotors, HasTheElementsOfTheSimulatedOne) {
  Claw claw(load("dclaw_emulated"));
  const SimulatedRobot simulated(load("dclaw").simulation);
  EXPECT_EQ(claw.robot->description().type, simulated.description().type);
  EXPECT_EQ(claw.robot->description().observation.text(),
            simulated.description().observation.text());
  EXPECT_EQ(claw.robot->description().action.text(), simulated.description().action.text());
}

TEST(DClawOnMotors, HoldsItsPoseWithItsWeightCarried) {
  Claw claw(load("dclaw_emulated"));
  claw.begin();
  ASSERT_TRUE(claw.step(Action{}));
  Action hold;
  ASSERT_EQ(claw.robot->hold(&claw.observation, &hold).state, DriverReport::State::kReady);
  EXPECT_NEAR(hold.torque[1], -0.0652, 2e-3);
  const Observation before = claw.observation;
  for (int i = 0; i < 3000; ++i) ASSERT_TRUE(claw.step(hold)) << claw.fault();
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(claw.observation.position[i], before.position[i], 0.005) << i;
  }
}

TEST(DClawOnMotors, GoesFromAnyPoseToThatOfItsSessions) {
  Claw claw(load("dclaw_emulated"));
  for (std::size_t i = 0; i < kJoints; ++i) {
    claw.plant.set_position(i, i % 3 == 0 ? 0.3 : i % 3 == 1 ? 0.2 : -0.4);
  }
  claw.begin();
  ASSERT_TRUE(claw.step(Action{}));
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(claw.observation.position[i], claw.robot->options().initial_position[i], 0.0873)
        << i;
  }
}

TEST(DClawOnMotors, TurnsAValveThatASensorMeasures) {
  Claw claw(load("dclaw_emulated"));
  claw.begin();
  for (int i = 0; i < 1500; ++i) ASSERT_TRUE(claw.step(to_finger({0, 0, 0}))) << claw.fault();
  EXPECT_NEAR(claw.observation.joint_position[kJoints], 0.0, 0.01);
  for (int i = 0; i < 1500; ++i) ASSERT_TRUE(claw.step(to_finger({0.7, 0, 0}))) << claw.fault();
  const double valve = claw.plant.data().qpos[claw.plant.model().mujoco()->nq - 1];
  EXPECT_GT(std::abs(valve), 0.05);
  EXPECT_NEAR(claw.observation.joint_position[kJoints], valve, 0.01);
}

TEST(DClawOnMotors, HasNoAngleOfAValveWithoutASensor) {
  Claw claw(load("dclaw_dynamixel"));
  claw.begin();
  ASSERT_TRUE(claw.step(Action{}));
  EXPECT_TRUE(std::isnan(claw.observation.joint_position[kJoints]));
  EXPECT_EQ(claw.observation.joint_position[0], claw.observation.position[0]);
}

TEST(DClawOnMotors, FollowsPositionsByItself) {
  Claw claw(load("dclaw_emulated", {"dynamixel.mode=position"}));
  claw.begin();
  for (int i = 0; i < 2000; ++i) {
    ASSERT_TRUE(claw.step(to_finger({0.2, -0.8, 0.8}))) << claw.fault();
  }
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(claw.observation.position[i], i % 3 == 0 ? 0.2 : i % 3 == 1 ? -0.8 : 0.8, 0.02);
  }
}

// Numbers like those of a hostile user, through the safety chain and the bus.
TEST(DClawOnMotors, IsHeldByTheSafetyChainUnderHostileActions) {
  const std::int64_t steps = repetitions(20'000, 1'000'000);
  Claw claw(load("dclaw_emulated", {"dynamixel.max_current=2.3"}));
  claw.begin();
  std::mt19937 random(1);
  int way = 0;
  for (std::int64_t step = 0; step < steps; ++step) {
    if (random() % 200 == 0) way = static_cast<int>(random() % 4);
    Action action;
    for (std::size_t i = 0; i < kJoints; ++i) {
      if (way < 2) {
        action.torque[i] = (way == 0 ? random() % 2 : i % 2) == 0 ? 1e9 : -1e9;
      } else if (way == 2) {
        action.torque[i] = random() % 8 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1.0;
        action.position_kp[i] = std::uniform_real_distribution(-1.0, 10.0)(random);
      } else {
        action.position[i] = std::uniform_real_distribution(-4.0, 4.0)(random);
      }
    }
    ASSERT_TRUE(claw.step(action)) << claw.fault() << " in step " << step;
  }
}

TEST(DClawOnMotors, SurvivesALineThatLosesAndDamagesPackets) {
  Claw claw(load("dclaw_emulated"), {.lost = 0.02, .damaged = 0.02, .seed = 5});
  claw.begin();
  for (int i = 0; i < 5000; ++i) {
    ASSERT_TRUE(claw.step(to_finger({0.2 * std::sin(0.003 * i), -1.0, 1.0})))
        << claw.fault() << " in step " << i;
  }
  EXPECT_GT(claw.report.lost_frames + claw.robot->motors().counts.missing, 0U);
}

// ---- a TriFinger on such motors ----

RobotConfig trifinger_on_motors() {
  const std::string path = testing::TempDir() + "trifinger_on_motors.yml";
  std::ofstream file(path);
  file << "extends: " TRIFINGER_CONFIG_DIR "/trifinger_pro.yml\n"
       << "driver: dynamixel\n"
       << "stop: {damping_time: 0.1, rest_position: [0, 0.9, -1.7], move_time: 4}\n"
       << "dynamixel:\n  port: emulated\n  baud: 4000000\n  mode: torque\n"
       << "  torque_constant: 1.3\n  max_current: 1\n  motors:\n";
  int id = 10;
  for (const std::string& joint : joint_names(RobotDescription{.variant = Variant::kPro})) {
    file << "    " << joint << ": {id: " << id++ << "}\n";
  }
  file.close();
  return load_robot_config(path);
}

TEST(TriFingerOnMotors, IsATriFingerWithoutSensorsAtItsTips) {
  Claw robot(trifinger_on_motors());
  EXPECT_EQ(robot.robot->description().type, TriFinger::kType);
  EXPECT_EQ(robot.robot->description().observation, describe<TriFinger::Observation>());
  robot.begin();
  ASSERT_TRUE(robot.step(Action{}));
  TriFinger::Observation y;
  ASSERT_EQ(robot.robot->get_latest_observation(&y).state, DriverReport::State::kReady);
  EXPECT_THAT(y.tip_force, testing::Each(testing::IsNan()));
}

TEST(TriFingerOnMotors, FollowsPositionsAndComesToRestAfterASession) {
  Claw robot(trifinger_on_motors());
  robot.begin();
  const Action there = to_finger({0.1, 1.1, -1.9});
  for (int i = 0; i < 3000; ++i) ASSERT_TRUE(robot.step(there)) << robot.fault();
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(robot.observation.position[i], there.position[i], 0.1) << i;
  }
  TimeIndex step = 0;
  for (; step < 4100; ++step) {
    ASSERT_EQ(robot.robot->stop(step).state, DriverReport::State::kBusy)
        << step << ": " << robot.robot->fault_text(0);
  }
  static_cast<void>(robot.robot->get_latest_observation(&robot.observation));
  const Action rest = to_finger({0.0, 0.9, -1.7});
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(robot.observation.position[i], rest.position[i], 0.1) << i;
  }
  while (robot.robot->stop(step).state == DriverReport::State::kBusy) ASSERT_LT(++step, 4200);
}

// ---- the configuration of D'Claw ----

TEST(DClawOnMotors, IsReadFromItsConfiguration) {
  const RobotConfig config = load("dclaw_dynamixel");
  ASSERT_NE(config.servos, nullptr);
  EXPECT_EQ(config.name, "dclaw-dynamixel");
  EXPECT_EQ(config.backend.period, 1ms);
  EXPECT_EQ(config.servos->port, "/dev/ttyUSB0");
  EXPECT_EQ(config.servos->baud, 4'000'000);
  EXPECT_EQ(config.servos->group.watchdog, 100ms);
  const servos::ServoRobotOptions& robot = config.servos->robot;
  EXPECT_EQ(robot.motors[8].id, 32);
  EXPECT_NEAR(robot.motors[6].zero, -1.5707963, 1e-9);
  EXPECT_EQ(robot.reset.first, (std::vector<std::size_t>{1, 4, 7}));
  EXPECT_EQ(robot.reset.untangle.size(), 3U);
  EXPECT_EQ(robot.stop.damping_time, 500ms);
  EXPECT_EQ(robot.limits[0].max_torque, 3.0);
}

TEST(DClawOnMotors, RefusesAConfigurationThatMakesNoSense) {
  const auto message = [](const std::string& change) {
    return message_of<Error>([&] { (void)load("dclaw_dynamixel", {change}); });
  };
  EXPECT_THAT(message("dynamixel.baud=1234567"), HasSubstr("motors know 9600, 57600"));
  EXPECT_THAT(message("dynamixel.motors.FFJ10.id=11"), HasSubstr("motor 11 is named twice"));
  EXPECT_THAT(message("dynamixel.motors.FFJ10.direction=2"), HasSubstr("'1' or '-1'"));
  EXPECT_THAT(message("dynamixel.motors.FFJ10.idd=1"), HasSubstr("idd"));
  EXPECT_THAT(message("dynamixel.motors.FFJ11.ratio=3"),
              AllOf(HasSubstr("makes no sense: the motor of FFJ11 is at -6"),
                    HasSubstr("knows its angle within one turn only")));
  EXPECT_THAT(message("dynamixel.mode=velocity"), HasSubstr("'torque' or 'position'"));
  EXPECT_THAT(message("dynamixel.watchdog=0.03"), HasSubstr("must be a multiple of 20 ms"));
  EXPECT_THAT(message("dynamixel.reset.first=[FFJ1]"), HasSubstr("'FFJ1', which is no driven"));
  EXPECT_THAT(message("dynamixel.reset.untangle.FFJ10=2"), HasSubstr("its soft limits are"));
  EXPECT_THAT(message("dynamixel.max_current=0"), HasSubstr("must be more than 0"));
  // The stops of the joint of a sensor are those of the model.
  EXPECT_THAT(
      message_of<Error>([] { (void)load("dclaw_emulated", {"dynamixel.sensors.valve.ratio=3"}); }),
      HasSubstr("the motor of sensor 50 is at -18.84 rad where the joint is at -6.28"));
}

// ---- in real time, at a pseudo-terminal ----

// A busy machine may stop any thread for long, so nothing here has a short time limit.
class DClawAtATerminal : public testing::Test {
 protected:
  DClawAtATerminal() {
    servos::ServoConfig servos = *config_.servos;
    servos.slack = 5s;
    servos.group.watchdog = 0ms;
    servos.group.silent_after = 60s;
    servos.loop.goal_timeout = 60s;
    servos.loop.realtime = {.demand = Demand::kOff};
    config_.servos = std::make_shared<const servos::ServoConfig>(servos);
  }
  void start() {
    plant_ = std::make_unique<ServoPlant>(config_.simulation, *config_.servos);
    emulator_ = std::make_unique<dynamixel::Emulator>(servos::emulated_motors(*config_.servos),
                                                      *plant_, dynamixel::EmulatedBusOptions{},
                                                      servos::emulated_port("claw").string());
  }
  // Calls until it is no longer busy. The watchdog of the tests ends a wait for ever.
  DriverReport wait(const std::function<DriverReport(TimeIndex)>& call) {
    DriverReport report = DriverReport::busy();
    for (TimeIndex step = 0; report.state == DriverReport::State::kBusy; ++step) {
      report = call(step);
      std::this_thread::sleep_for(1ms);
    }
    return report;
  }

  SessionFolder folder_;
  RobotConfig config_{load("dclaw_emulated")};
  std::unique_ptr<ServoPlant> plant_;
  std::unique_ptr<dynamixel::Emulator> emulator_;
};

TEST_F(DClawAtATerminal, SaysHowToStartTheMotorsIfThereAreNone) {
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)connect(*config_.servos, "claw"); }),
              AllOf(HasSubstr("no motors are emulated at"),
                    HasSubstr("start them with 'trifinger emulate'")));
  // An emulator that was killed leaves its link, which may lead anywhere.
  std::filesystem::create_symlink("/dev/null", servos::emulated_port("claw"));
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)connect(*config_.servos, "claw"); }),
              HasSubstr("no motors are emulated at"));
}

TEST_F(DClawAtATerminal, MovesAndNoticesWhenItsMotorsHaveGone) {
  start();
  const servos::ConnectedRobot connected = connect(*config_.servos, "claw");
  servos::ServoRobot& robot = *connected.robot;
  DriverReport report = wait([&](TimeIndex step) { return robot.prepare(step); });
  ASSERT_EQ(report.state, DriverReport::State::kReady) << robot.fault_text(report.fault_code);
  Observation observation;
  AppliedJointAction<kJoints> applied;
  const Action action = to_finger({0.2, -1.0, 1.0});
  report = wait([&](TimeIndex) {
    DriverReport step = robot.get_latest_observation(&observation);
    if (step.state != DriverReport::State::kReady) return step;
    step = robot.apply_action(&action, &applied);
    if (step.state != DriverReport::State::kReady) return step;
    return std::abs(observation.position[0] - 0.2) < 0.03 ? step : DriverReport::busy();
  });
  ASSERT_EQ(report.state, DriverReport::State::kReady) << robot.fault_text(report.fault_code);
  // A plug was pulled.
  emulator_.reset();
  report = wait([&](TimeIndex) {
    const DriverReport step = robot.get_latest_observation(&observation);
    return step.state == DriverReport::State::kReady ? DriverReport::busy() : step;
  });
  EXPECT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_THAT(std::string(robot.fault_text(report.fault_code)),
              HasSubstr("the serial line to the motors has gone"));
  EXPECT_EQ(wait([&](TimeIndex step) { return robot.stop(step); }).state,
            DriverReport::State::kReady);
}

}  // namespace
}  // namespace trifinger::test
