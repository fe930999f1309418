// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dynamixel/emulated_motor.hpp"
#include "dynamixel/motor_group.hpp"
#include "dynamixel/motor_loop.hpp"
#include "servos/servo_robot.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/config/node.hpp"

namespace trifinger::servos {

/// A robot on Dynamixel motors, and the serial line to them.
struct ServoConfig {
  /// The serial device; empty: that of `trifinger emulate` in another process of this user.
  std::string port{};
  int baud{1'000'000};
  ServoRobotOptions robot{};
  dynamixel::MotorGroupOptions group{};
  dynamixel::MotorLoopOptions loop{};
  Nanoseconds slack{std::chrono::milliseconds(4)};  ///< See `BusOptions`.
  /// The names of the joints that `robot.sensors` measure.
  std::vector<std::string> sensor_names{};
};

/// Reads the sections `dynamixel` and `stop` of a configuration. `joints` are the names of the
/// driven joints, `others` those of all joints that a sensor may measure. What belongs to the model
/// of the robot (types, limits, initial position, period, weight) remains to be set.
/// @throws config::ConfigError at the value that is wrong
[[nodiscard]] ServoConfig read_servo_config(const config::Node& root,
                                            const std::vector<std::string>& joints,
                                            const std::vector<std::string>& others);

/// The link to the emulated line of the robot of this name.
[[nodiscard]] std::filesystem::path emulated_port(const std::string& robot);

/// The motors of this robot as they come from the shop, apart from number and baud rate, for an
/// emulator.
[[nodiscard]] std::vector<dynamixel::EmulatedMotorOptions> emulated_motors(
    const ServoConfig& config);

/// A robot on its line, which is open.
struct ConnectedRobot {
  std::unique_ptr<ServoRobot> robot;
  std::vector<std::string> warnings;  ///< What adapter and machine refused, in sentences.
};

/// Opens the line. `name` is that of the session.
/// @throws InvalidArgument, SystemError with the remedy
[[nodiscard]] ConnectedRobot connect(const ServoConfig& config, const std::string& name);

}  // namespace trifinger::servos
