// SPDX-License-Identifier: BSD-3-Clause
#include "limits.hpp"

namespace trifinger::bindings {

std::optional<control::SafetyLimits> limits_of(const RobotConfig& config) {
  const auto& known = config.simulation.limits;
  if (!known || known->size() != kMaxJoints) return std::nullopt;
  const auto limits = trifinger::limits_of<kMaxJoints>(*known);
  return control::SafetyLimits{.max_torque = values_of(limits, &JointLimit::max_torque),
                               .safety_kd = values_of(limits, &JointLimit::safety_kd),
                               .soft_lower = values_of(limits, &JointLimit::soft_lower),
                               .soft_upper = values_of(limits, &JointLimit::soft_upper)};
}

}  // namespace trifinger::bindings
