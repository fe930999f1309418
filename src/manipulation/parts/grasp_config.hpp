// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "parts/task.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Reads how an object is grasped with three tips and held: where tips may touch it, and the section
// `grasp`. config/skills/grasping.yml documents the keys. Throws config::ConfigError.
void read_grasping(const config::Node& root, ManipulationConfig& config);
// The same, and the keys that the skills lift and slide share. The limits are those of `context`.
[[nodiscard]] ManipulationConfig read_manipulation(const SkillContext& context,
                                                   const config::Node& root);
// Reads what the sections of these skills share: where a task may begin.
void read_lead(const config::Node& section, ManipulationConfig& config);
// The configuration of this name in config/skills, which is no skill's own but only tells how an
// object is grasped. Throws config::ConfigError, InvalidArgument, SystemError.
[[nodiscard]] ManipulationConfig load_grasping(const SkillContext& context,
                                               const std::string& name);

}  // namespace trifinger::manipulation
