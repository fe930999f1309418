// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/config/node.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::detail {

// Reads from `driver` what moves the robot, and from the section of that name its motors. The
// simulation of `config` must be known. Throws config::ConfigError at the value that is wrong.
void read_motors(const config::Node& root, RobotConfig& config);

}  // namespace trifinger::detail
