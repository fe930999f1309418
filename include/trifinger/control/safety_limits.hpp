// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "trifinger/model/robot_description.hpp"

namespace trifinger::control {

/// The limits of the robot's safety checks that a controller must know, for each joint of a robot
/// with three fingers. The names are those of `JointLimits` and of the section `safety` in
/// configurations.
struct SafetyLimits {
  using Joints = std::array<double, kMaxJoints>;

  Joints max_torque;  ///< [Nm]
  Joints safety_kd;   ///< Damping that always acts [Nms/rad].
  Joints soft_lower;  ///< [rad]
  Joints soft_upper;  ///< [rad]
};

/// The limits of the real robot of this variant.
[[nodiscard]] SafetyLimits safety_limits(const RobotDescription& description) noexcept;

/// @throws InvalidArgument that names the first value that makes no sense.
void validate(const SafetyLimits& limits);

}  // namespace trifinger::control
