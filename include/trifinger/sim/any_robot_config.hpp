// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "trifinger/config/file.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/servos/read_options.hpp"
#include "trifinger/sim/file_robot.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger {

/// All settings of a robot from a file, in a configuration; docs/any_robot.md documents every key.
struct FileRobotConfig {
  std::string name;  ///< Name of the session.
  /// The robot, and how it is simulated; of a robot on motors, its model and its plant in an
  /// emulator.
  FileRobotOptions robot;
  std::optional<servos::ServoConfig> servos{};  ///< Only for a robot on Dynamixel motors.
  BackendOptions backend;
  SessionOptions session;  ///< Its documents include the configuration, but not the model.
};

/// The settings of any robot that a configuration can describe.
using AnyRobotConfig = std::variant<RobotConfig, FileRobotConfig>;

/// Loads the configuration file `name`, see `find_config`. The path of a robot's file counts from
/// the folder of the configuration that names it; here it is made absolute, so that the text of the
/// configuration means the same everywhere.
/// @throws config::ConfigError, InvalidArgument, SystemError
[[nodiscard]] config::File load_config_file(const std::string& name,
                                            const std::vector<std::string>& overrides = {});

/// Whether a configuration that has been loaded is that of a robot from a file.
[[nodiscard]] bool is_from_file(const config::File& file);

/// Reads the configuration `name` of any robot, like `load_robot_config`.
/// @throws config::ConfigError at the value that is wrong, InvalidArgument, SystemError
[[nodiscard]] AnyRobotConfig load_any_robot_config(const std::string& name,
                                                   const std::vector<std::string>& overrides = {});

/// Reads a configuration that has been loaded. The robot's file must still be where it was.
/// @throws config::ConfigError at the value that is wrong, InvalidArgument
[[nodiscard]] AnyRobotConfig read_any_robot_config(const config::File& file);

}  // namespace trifinger
