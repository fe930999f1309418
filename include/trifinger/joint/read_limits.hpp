// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "trifinger/config/node.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/limits.hpp"

namespace trifinger {

namespace detail {

// Reads one number for all `values`, or a list that is repeated until each has its number.
void read_repeated(const config::Node& node, const config::Range& range, std::span<double> values);

}  // namespace detail

/// Reads the limits of all joints from a section that has every key of `JointLimit::fields()`. A
/// value is one number for all joints, or a list that is repeated until every joint has its number:
/// three numbers serve each finger of a robot.
/// @throws config::ConfigError at the value that is wrong.
void read_joint_limits(const config::Node& section, std::span<JointLimit> limits);

/// A joint of a robot whose joints have names, and what is known of its limits already.
struct NamedJoint {
  std::string name;
  JointKind kind{JointKind::kHinge};
  JointLimit known{};  ///< Limits from the robot's file; NaN: not known.
};

/// Reads the limits of these joints from the section "safety" of `root`. It has a section for each
/// joint, under its name, and a section "every_joint" for values that hold for all joints that do
/// not say otherwise:
///
///     safety:
///       every_joint: {safety_kd: 1, max_velocity: 2, braking: 10, default_kp: 50, default_kd: 5}
///       joint1: {soft_lower: -2.8, soft_upper: 2.8}
///
/// What the section does not say is taken from `known`. These values need not be said: `max_kp`
/// and `max_kd` are then the default gains, and `max_torque_rate`, `continuous_torque`,
/// `thermal_time` and `plausibility` are off. A soft or hard limit may be infinite.
/// @throws config::ConfigError at a value that is wrong. One error names all values that nobody
/// has said, as text to be filled in. InvalidArgument if a joint is called "every_joint".
[[nodiscard]] std::vector<JointLimit> read_limits_by_name(const config::Node& root,
                                                          std::span<const NamedJoint> joints);

}  // namespace trifinger
