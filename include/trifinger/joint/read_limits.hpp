// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>

#include "trifinger/config/node.hpp"
#include "trifinger/joint/limits.hpp"

namespace trifinger {

namespace detail {

void read_joint_limits(const config::Node& section, std::span<JointLimit> limits);

// Reads one number for all `values`, or a list that is repeated until each has its number.
void read_repeated(const config::Node& node, const config::Range& range, std::span<double> values);

}  // namespace detail

/// Reads the limits of N joints from a section that has every key of `JointLimit::fields()`. A
/// value is one number for all joints, or a list that is repeated until every joint has its number:
/// three numbers serve each finger of a robot.
/// @throws config::ConfigError at the value that is wrong.
template <std::size_t N>
[[nodiscard]] JointLimits<N> read_joint_limits(const config::Node& section) {
  JointLimits<N> limits;
  detail::read_joint_limits(section, limits);
  return limits;
}

}  // namespace trifinger
