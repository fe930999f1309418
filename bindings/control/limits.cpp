// SPDX-License-Identifier: BSD-3-Clause
#include "limits.hpp"

#include <variant>

namespace trifinger::bindings {

std::optional<control::SafetyLimits> limits_of(const RobotConfig& config) {
  const auto* const options = std::get_if<SimulationOptions<TriFinger>>(&config.simulation);
  if (options == nullptr || !options->limits) return std::nullopt;
  const JointLimits<kMaxJoints>& limits = *options->limits;
  return control::SafetyLimits{.max_torque = values_of(limits, &JointLimit::max_torque),
                               .safety_kd = values_of(limits, &JointLimit::safety_kd),
                               .soft_lower = values_of(limits, &JointLimit::soft_lower),
                               .soft_upper = values_of(limits, &JointLimit::soft_upper)};
}

}  // namespace trifinger::bindings
