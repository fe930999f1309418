// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "trifinger/config/node.hpp"
#include "trifinger/joint/limits.hpp"

namespace trifinger {

namespace detail {

// Fills the ten arrays, in the order of `joint_limit_fields`.
void read_joint_limits(const config::Node& section,
                       std::span<const std::span<double>, kJointLimitFields> values);

}  // namespace detail

/// Reads the limits of N joints from a section with one key per member of `JointLimits`, all of
/// them required. A value is one number for all joints, or a list that is repeated until every
/// joint has its number: three numbers serve each finger of a robot.
/// @throws config::ConfigError at the value that is wrong.
template <std::size_t N>
[[nodiscard]] JointLimits<N> read_joint_limits(const config::Node& section) {
  JointLimits<N> limits{};
  const std::array<std::span<double>, detail::kJointLimitFields> values{
      limits.max_torque, limits.safety_kd,  limits.soft_lower, limits.soft_upper, limits.hard_lower,
      limits.hard_upper, limits.default_kp, limits.default_kd, limits.max_kp,     limits.max_kd};
  detail::read_joint_limits(section, values);
  return limits;
}

}  // namespace trifinger
