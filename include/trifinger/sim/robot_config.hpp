// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
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

/// Where the configurations that come with the program may be, the first of which counts:
/// $TRIFINGER_CONFIG_DIR, beside the Python module that this code is linked into, and the share
/// folder that belongs to the program. Configurations of users extend these by their names. Those
/// of other things than robots are in a `folder` of their own there, as in "manipulate".
[[nodiscard]] std::vector<std::filesystem::path> config_folders(const std::string& folder = "");

/// Finds the file of a configuration: a path, or the name of one that comes with the program, as in
/// "sim" or "trifinger_pro", which is looked for in `config_folders`.
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

/// A value that two configurations do not share; none where one of them does not have it.
struct ConfigDifference {
  std::string key;  ///< "fingers.height", "object 'cube'"
  std::optional<std::string> value{};
  std::optional<std::string> other{};
};

/// What a controller would notice if it came from the robot of the configuration `other` to that of
/// `robot`. Names, seeds, noise, where things are at the beginning, and what happens to late
/// actions and at ends are left out. Neither needs to have all keys of this version.
/// @throws config::ConfigError for objects that have no meaning
[[nodiscard]] std::vector<ConfigDifference> differences(const config::File& robot,
                                                        const config::File& other);

/// The file of the configuration that a robot's back-end was given.
/// @throws InvalidArgument if the session has none, config::ConfigError
[[nodiscard]] config::File config_file_of(const Session& session);

/// The configuration that a robot's back-end was given.
/// @throws InvalidArgument if the session has none
[[nodiscard]] RobotConfig robot_config_of(const Session& session);

}  // namespace trifinger
