// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guided_robot.hpp"

#include <algorithm>
#include <cstddef>
#include <span>

#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::guiding {
namespace {

GuidedRobot make(const RobotDescription& description, std::span<const JointLimit> limits) {
  GuidedRobot robot{.description = description,
                    .home = JointValues(static_cast<int>(limits.size()))};
  const VariantFigures& variant = figures(description);
  for (std::size_t i = 0; i < limits.size(); ++i) {
    robot.limits[i] = limits[i];
    robot.home[static_cast<int>(i)] = std::clamp(variant.initial_position[i % kJointsPerFinger],
                                                 limits[i].soft_lower, limits[i].soft_upper);
  }
  return robot;
}

}  // namespace

GuidedRobot guided_robot(const RobotDescription& description) {
  return make(description, default_limits(description));
}

GuidedRobot guided_robot(const Session& session) {
  const RobotConfig config = robot_config_of(session);
  const RobotDescription& description = description_of(config);
  return make(description, config.simulation.limits.value_or(default_limits(description)));
}

}  // namespace trifinger::guiding
