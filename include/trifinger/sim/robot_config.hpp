// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/camera/options.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger {

namespace servos {
struct ServoConfig;
}
struct BoardsConfig;

/// All settings of a robot in a configuration file. config/trifinger_edu.yml documents every key,
/// docs/any_robot.md those of a robot from a file.
struct RobotConfig {
  std::string name;  ///< Name of the session.
  /// The robot, and how it is simulated; of a robot on boards or motors, its model and its plant in
  /// an emulator.
  SimulationOptions simulation;
  std::shared_ptr<const BoardsConfig> boards{};         ///< Only for a robot on motor boards.
  std::shared_ptr<const servos::ServoConfig> servos{};  ///< Only for a robot on Dynamixel motors.
  std::optional<camera::CameraOptions> cameras{};       ///< Only for a robot with cameras.
  /// Objects are known only from the images of cameras.
  bool tracks_objects{false};
  BackendOptions backend;
  SessionOptions session;  ///< Its documents include the configuration, but not the model.
};

/// Folders in which the configurations that come with the program are searched, in this order:
/// $TRIFINGER_CONFIG_DIR, the folder beside the Python module that contains this code, and the
/// program's share folder. Configurations of users extend these by their names. Configurations of
/// other things than robots are in a subfolder `folder`, for example "manipulate".
[[nodiscard]] std::vector<std::filesystem::path> config_folders(const std::string& folder = "");

/// Finds the file of a configuration. `name` is a path, or the name of a configuration that comes
/// with the program, such as "sim" or "trifinger_pro". Names are looked for in `config_folders`.
/// @throws InvalidArgument with the existing names
[[nodiscard]] std::filesystem::path find_config(const std::string& name,
                                                const std::string& folder = "");

/// The names of the configurations that come with the program.
[[nodiscard]] std::vector<std::string> config_names(const std::string& folder = "");

/// Loads the configuration file `name`, see `find_config`. The path of a robot's file counts from
/// the folder of the configuration that names it; here it is made absolute, so that the text of the
/// configuration means the same everywhere.
/// @throws config::ConfigError, InvalidArgument, SystemError
[[nodiscard]] config::File load_config_file(const std::string& name,
                                            const std::vector<std::string>& overrides = {});

/// Whether a configuration that has been loaded is that of a robot from a file.
[[nodiscard]] bool is_from_file(const config::File& file);

/// Reads the configuration `name`, see `find_config`, with `overrides` such as
/// "fingers.height=0.3".
/// @throws config::ConfigError at the value that is wrong, InvalidArgument, SystemError
[[nodiscard]] RobotConfig load_robot_config(const std::string& name,
                                            const std::vector<std::string>& overrides = {});

/// Reads a configuration that has been loaded, such as the document "configuration.yml" of a
/// session. The file of the robot must still be where it was.
/// @throws config::ConfigError at the value that is wrong, InvalidArgument
[[nodiscard]] RobotConfig read_robot_config(const config::File& file);

/// The description of a configured robot, for what knows only TriFingers and single fingers.
/// @throws InvalidArgument if the robot is from a file
[[nodiscard]] const RobotDescription& description_of(const RobotConfig& config);

/// A value that differs between two configurations. Empty where a configuration does not have it.
struct ConfigDifference {
  std::string key;  ///< "fingers.height", "object 'cube'"
  std::optional<std::string> value{};
  std::optional<std::string> other{};
};

/// The differences that a controller would notice if it moved from the robot of the configuration
/// `other` to that of `robot`. Left out are names, seeds, noise, initial poses, and the handling of
/// late actions and of ends. Keys of this version may be missing in both.
/// @throws config::ConfigError for objects that make no sense
[[nodiscard]] std::vector<ConfigDifference> differences(const config::File& robot,
                                                        const config::File& other);

/// The configuration file that a robot's back-end has used.
/// @throws InvalidArgument if the session has none, config::ConfigError
[[nodiscard]] config::File config_file_of(const Session& session);

/// The configuration that a robot's back-end has used. No file is opened that an untrusted session
/// names: for a robot of one's own that is from a file, read what `config_file_of` returns.
/// @throws InvalidArgument if the session has none, or if the robot is from a file
[[nodiscard]] RobotConfig robot_config_of(const Session& session);

}  // namespace trifinger
