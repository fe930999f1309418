// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guided_robot.hpp"

#include <algorithm>
#include <cstddef>
#include <variant>

#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::guiding {
namespace {

template <std::size_t N>
GuidedRobot make(const RobotDescription& description, const JointLimits<N>& limits) {
  GuidedRobot robot{.description = description, .home = JointValues(static_cast<int>(N))};
  const VariantFigures& variant = figures(description);
  for (std::size_t i = 0; i < N; ++i) {
    robot.limits[i] = limits[i];
    robot.home[static_cast<int>(i)] = std::clamp(variant.initial_position[i % kJointsPerFinger],
                                                 limits[i].soft_lower, limits[i].soft_upper);
  }
  return robot;
}

}  // namespace

template <class R>
GuidedRobot guided_robot(const RobotDescription& description) {
  return make(description, default_limits<R>(description));
}

template GuidedRobot guided_robot<TriFinger>(const RobotDescription&);
template GuidedRobot guided_robot<Finger>(const RobotDescription&);

GuidedRobot guided_robot(const Session& session) {
  const RobotConfig config = robot_config_of(session);
  return std::visit(
      []<class R>(const SimulationOptions<R>& options) {
        return make(options.description,
                    options.limits.value_or(default_limits<R>(options.description)));
      },
      config.simulation);
}

}  // namespace trifinger::guiding
