// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "robot/finding.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {

// Judges every CAN interface of this machine by what motor boards need. Nobody knows whether a
// robot uses them, so what is wrong is a note.
[[nodiscard]] std::vector<Finding> examine_can_interfaces();

// Judges what the boards of a robot need: its interfaces or emulated buses, and whether each board
// answers, for which it listens up to some seconds. `configuration` is what the user calls it,
// `robot` the robot's name. It sends nothing, so the robot may run.
[[nodiscard]] std::vector<Finding> examine_boards(const BoardsConfig& config,
                                                  const std::string& configuration,
                                                  const std::string& robot);

}  // namespace trifinger::apps
