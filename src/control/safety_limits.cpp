// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/safety_limits.hpp"

#include "trifinger/base/error.hpp"

namespace trifinger::control {

using detail::require_not_negative;
using detail::require_positive;

SafetyLimits safety_limits(const RobotDescription& description) noexcept {
  const VariantFigures& finger = figures(description);
  SafetyLimits limits{};
  limits.max_torque.fill(actuator(description).torque_limit);
  for (std::size_t i = 0; i < kMaxJoints; ++i) {
    const std::size_t joint = i % kJointsPerFinger;
    limits.safety_kd[i] = finger.safety_kd[joint];
    limits.soft_lower[i] = finger.soft_lower[joint];
    limits.soft_upper[i] = finger.soft_upper[joint];
  }
  return limits;
}

void validate(const SafetyLimits& limits) {
  for (std::size_t i = 0; i < kMaxJoints; ++i) {
    require_positive("max_torque", limits.max_torque[i]);
    require_not_negative("safety_kd", limits.safety_kd[i]);
    // Written so that NaN fails.
    if (!(limits.soft_lower[i] < limits.soft_upper[i]))
      throw InvalidArgument("soft_lower is not below soft_upper");
  }
}

}  // namespace trifinger::control
