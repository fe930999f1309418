// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "manipulation/parts/task.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// The shipped configuration of the skill lift for a robot, with some of its values replaced:
// "lift.height=0.1". Throws config::ConfigError, InvalidArgument, SystemError.
[[nodiscard]] ManipulationConfig load_lift(const SkillContext& context,
                                           const std::vector<std::string>& overrides = {});

}  // namespace trifinger::manipulation
