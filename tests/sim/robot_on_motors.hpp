// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dynamixel/emulated_bus.hpp"
#include "dynamixel/emulated_port.hpp"
#include "dynamixel/stepped_motors.hpp"
#include "servos/servo_robot.hpp"
#include "sim/servo_plant.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::test {

/// A configuration that comes with the program.
inline RobotConfig load(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return load_robot_config(std::string(TRIFINGER_CONFIG_DIR "/") + name + ".yml", overrides);
}

/// A robot on emulated motors in simulated time, with its simulation as what they move.
template <std::size_t kJoints, class Observation>
class RobotOnMotors {
 public:
  explicit RobotOnMotors(RobotConfig config, const dynamixel::LineFaults& faults = {})
      : plant(config.simulation, *config.servos),
        line(servos::emulated_motors(*config.servos), plant, kBegin, {.faults = faults}) {
    auto port = std::make_unique<dynamixel::EmulatedPort>(line, config.servos->baud, kBegin);
    auto group = std::make_unique<dynamixel::MotorGroup>(
        std::move(port), servos::group_options(config.servos->robot, config.servos->group));
    robot = std::make_unique<servos::ServoRobot>(
        config.servos->robot, std::make_unique<dynamixel::SteppedMotors>(std::move(group)));
  }

  void prepare() {
    report = DriverReport::busy();
    for (TimeIndex step = 0; report.state == DriverReport::State::kBusy; ++step) {
      ASSERT_LT(step, 60'000);
      report = robot->prepare(step);
    }
  }
  void begin() {
    prepare();
    ASSERT_EQ(report.state, DriverReport::State::kReady) << fault();
  }
  [[nodiscard]] bool step(const JointAction<kJoints>& action) {
    report = robot->get_latest_observation(&observation);
    if (report.state != DriverReport::State::kReady) return false;
    report = robot->apply_action(&action, &applied);
    return report.state == DriverReport::State::kReady;
  }
  [[nodiscard]] std::string fault() const {
    return std::string(robot->fault_text(report.fault_code));
  }

 private:
  static constexpr Instant kBegin{std::chrono::seconds(1000)};

 public:
  ServoPlant plant;
  dynamixel::EmulatedBus line;
  std::unique_ptr<servos::ServoRobot> robot;
  Observation observation{};
  AppliedJointAction<kJoints> applied{};
  DriverReport report{};
};

}  // namespace trifinger::test
