// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "trifinger/model/robot_description.hpp"

namespace trifinger::control {

/// What a controller has to know of the safety checks between it and a robot of three fingers, for
/// each joint. The names are those of `JointLimits` and of the section `safety` of configurations.
struct SafetyLimits {
  using Joints = std::array<double, kMaxJoints>;

  Joints max_torque;  ///< [Nm]
  Joints safety_kd;   ///< Damping that always acts [Nms/rad].
  Joints soft_lower;  ///< [rad]
  Joints soft_upper;  ///< [rad]
};

/// Those of the real robot of this variant.
[[nodiscard]] SafetyLimits safety_limits(const RobotDescription& description) noexcept;

/// @throws InvalidArgument naming the first value that makes no sense.
void validate(const SafetyLimits& limits);

}  // namespace trifinger::control
