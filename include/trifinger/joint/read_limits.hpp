// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "trifinger/config/node.hpp"
#include "trifinger/joint/limits.hpp"

namespace trifinger {

namespace detail {

using MutableJointLimitValues = std::array<std::span<double>, kJointLimitFields>;

// Fills the arrays, in the order of `joint_limit_fields`.
void read_joint_limits(const config::Node& section, const MutableJointLimitValues& values);

}  // namespace detail

/// Reads the limits of N joints from a section. It has one key per member of `JointLimits`, and a
/// section `plausibility` with the members of that name. All keys are required. A value is one
/// number for all joints, or a list that is repeated until every joint has its number: three
/// numbers serve each finger of a robot.
/// @throws config::ConfigError at the value that is wrong.
template <std::size_t N>
[[nodiscard]] JointLimits<N> read_joint_limits(const config::Node& section) {
  JointLimits<N> limits{};
  detail::read_joint_limits(section,
                            detail::joint_limit_arrays<detail::MutableJointLimitValues>(limits));
  return limits;
}

}  // namespace trifinger
