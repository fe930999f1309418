// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/config/node.hpp"
#include "trifinger/manipulation/task.hpp"

namespace trifinger::manipulation {

// Reads how an object is grasped with three tips and held: where tips may touch it, and the section
// `grasp`. config/manipulate/edu.yml documents the keys. Throws config::ConfigError.
void read_grasping(const config::Node& root, ManipulationConfig& config);

}  // namespace trifinger::manipulation
