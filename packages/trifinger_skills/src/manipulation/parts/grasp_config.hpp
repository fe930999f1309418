// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "manipulation/parts/task.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Reads how an object is grasped with three tips, held, and, with the keys of `section`, led to
// where a lift or a slide may begin. The limits are those of `context`. config/skills/grasping.yml,
// lift.yml and slide.yml document the keys. Throws config::ConfigError.
[[nodiscard]] ManipulationConfig read_manipulation(const SkillContext& context,
                                                   const config::Node& root,
                                                   const config::Node& section, Task task,
                                                   std::vector<double> distances);
// How a skill that is about more grasps `object`, one grasp at a time: `grasp` in `section` names a
// file like grasping.yml, and `planned_friction` and perhaps `heights` are there, too.
// Throws config::ConfigError, InvalidArgument, SystemError.
[[nodiscard]] GraspingConfig load_grasping(const SkillContext& context, const config::Node& section,
                                           const std::string& object);

}  // namespace trifinger::manipulation
