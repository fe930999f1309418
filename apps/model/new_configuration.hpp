// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "trifinger/model/model_file.hpp"

namespace trifinger::apps {

// A robot in a file, for which there will be a configuration.
struct SimulatedRobotFiles {
  std::string name;
  std::filesystem::path file;
  std::optional<std::filesystem::path> meshes;
  std::filesystem::path folder;  // of the configuration
  bool repair_inertia{false};
  bool angle_in_radians{false};
  std::string collision;  // hull, visual or none; empty: as usual
};

[[nodiscard]] inline bool is_urdf(const SimulatedRobotFiles& files) {
  return files.file.extension() == ".urdf";
}

// For joints that can hardly move.
inline constexpr std::string_view kHowToTakeRadians =
    "if the file means radians, add angle: radian (--angle radian)";

// Throws InvalidArgument.
[[nodiscard]] ModelFile model_of(const SimulatedRobotFiles& files);

// A configuration with which the robot can be simulated at once. FILL_IN stands in the place of a
// torque that nobody knows.
[[nodiscard]] std::string configuration_of(const SimulatedRobotFiles& files,
                                           const ModelFile& model);

}  // namespace trifinger::apps
