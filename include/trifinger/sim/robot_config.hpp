// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "trifinger/config/file.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger {

/// All that a configuration file says about a robot. config/trifinger_edu.yml documents every key.
struct RobotConfig {
  std::string name;  ///< Of the session.
  std::variant<SimulationOptions<TriFinger>, SimulationOptions<Finger>> simulation;
  BackendOptions backend;
  SessionOptions session;  ///< The configuration is among its documents, the model is not.
};

/// Finds the file of a configuration: a path, or the name of one that comes with the program, as in
/// "sim" or "trifinger_pro". These are looked for in $TRIFINGER_CONFIG_DIR and where the program
/// was installed. Those of other things than robots are in a `folder` of their own there, as in
/// "manipulate".
/// @throws InvalidArgument with the names there are
[[nodiscard]] std::filesystem::path find_config(const std::string& name,
                                                const std::string& folder = "");

/// The names of the configurations that come with the program.
[[nodiscard]] std::vector<std::string> config_names(const std::string& folder = "");

/// Reads the configuration `name`, see `find_config`, with `overrides` such as
/// "fingers.height=0.3".
/// @throws config::ConfigError at the value that is wrong, InvalidArgument, SystemError
[[nodiscard]] RobotConfig load_robot_config(const std::string& name,
                                            const std::vector<std::string>& overrides = {});

/// Reads a configuration that has been loaded, such as the document "configuration.yml" of a
/// session.
/// @throws config::ConfigError at the value that is wrong, InvalidArgument
[[nodiscard]] RobotConfig read_robot_config(const config::File& file);

/// The configuration that a robot's back-end was given.
/// @throws InvalidArgument if the session has none
[[nodiscard]] RobotConfig robot_config_of(const Session& session);

}  // namespace trifinger
