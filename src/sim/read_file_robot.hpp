// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/config/file.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::detail {

// True if the section "robot" names a file with a model.
[[nodiscard]] inline bool is_from_file(const config::Node& root) {
  const auto robot = root.optional_section("robot");
  return robot && (robot->find("mjcf") || robot->find("urdf"));
}

// The node that names this file.
[[nodiscard]] config::Node file_node(const config::Node& root);

// Reads the configuration of such a robot. Throws config::ConfigError at the value that is wrong.
[[nodiscard]] RobotConfig read_file_robot(const config::File& file);

}  // namespace trifinger::detail
