// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "trifinger/base/error.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger {

/// The bounds outside of which measurements are not plausible. Infinity (`.inf` in a configuration)
/// switches a check off.
template <std::size_t N>
struct PlausibilityLimits {
  JointVector<N> max_position_rate;    ///< A faster change of position counts as a jump [rad/s].
  JointVector<N> max_velocity_error;   ///< Largest error of velocity against position [rad/s].
  JointVector<N> velocity_error_time;  ///< Time constant of the filter of this error [s].
  JointVector<N> stuck_torque;         ///< A joint is stuck if torque varies by more, ... [Nm]
  JointVector<N> stuck_time;           ///< ... and nothing moves for this long [s].
};

/// Limits for the joints of a robot. There are no defaults: a limit that was forgotten must not be
/// replaced by a guess.
template <std::size_t N>
struct JointLimits {
  JointVector<N> max_torque;  ///< More than 0 [Nm].
  JointVector<N> safety_kd;   ///< Damping that always acts, at least 0 [Nms/rad].
  JointVector<N> soft_lower;  ///< Targets are clamped here, and the joint is pushed back [rad].
  JointVector<N> soft_upper;  ///< [rad]
  JointVector<N>
      hard_lower;  ///< Beyond this the robot stops with a fault; not inside the soft limit [rad].
  JointVector<N> hard_upper;    ///< [rad]
  JointVector<N> default_kp;    ///< Gains of a position that is given without gains [Nm/rad].
  JointVector<N> default_kd;    ///< [Nms/rad]
  JointVector<N> max_kp;        ///< Largest gains that a user may ask for [Nm/rad].
  JointVector<N> max_kd;        ///< [Nms/rad]
  JointVector<N> max_velocity;  ///< A faster joint is braked [rad/s]; may be infinite.
  JointVector<N> braking;  ///< Deceleration used to slow the joint before a soft limit [rad/s^2].
  JointVector<N> max_torque_rate;    ///< Largest change of requested torque [Nm/s]; may be
                                     ///< infinite.
  JointVector<N> continuous_torque;  ///< Torque that a motor gives for ever [Nm]; may be infinite.
  JointVector<N> thermal_time;       ///< Time constant of the motor's warming [s]; may be infinite.
  PlausibilityLimits<N> plausibility;

  /// @throws InvalidArgument that names the joint, the value found and the value allowed.
  void validate() const;
};

/// The limits of one joint. `JointLimits` documents them.
struct JointLimit {
  double max_torque;
  double safety_kd;
  double soft_lower;
  double soft_upper;
  double hard_lower;
  double hard_upper;
  double default_kp;
  double default_kd;
  double max_kp;
  double max_kd;
  double max_velocity;
  double braking;
  double max_torque_rate;
  double continuous_torque;
  double thermal_time;
  double max_position_rate;
  double max_velocity_error;
  double velocity_error_time;
  double stuck_torque;
  double stuck_time;
};

/// A limit that makes no sense.
struct JointLimitProblem {
  std::size_t joint{0};
  std::string_view field;  ///< For example "soft_lower" or "plausibility.stuck_time".
  std::string text;        ///< For example "is 1.2 rad, must be less than soft_upper (0.5 rad)".
};

namespace detail {

// The arrays of JointLimits in the order of their declaration.
struct JointLimitField {
  std::string_view name;  // dotted for a member of a member
  std::string_view unit;
  bool may_be_infinite{false};  // infinity means "no limit"
};
inline constexpr std::size_t kJointLimitFields = 20;
[[nodiscard]] std::span<const JointLimitField, kJointLimitFields> joint_limit_fields() noexcept;

using JointLimitValues = std::array<std::span<const double>, kJointLimitFields>;

// `Limits` is a JointLimits, const or not. `Values` is an array of spans of its numbers.
template <class Values, class Limits>
[[nodiscard]] Values joint_limit_arrays(Limits& limits) noexcept {
  auto& plausibility = limits.plausibility;
  return {limits.max_torque,
          limits.safety_kd,
          limits.soft_lower,
          limits.soft_upper,
          limits.hard_lower,
          limits.hard_upper,
          limits.default_kp,
          limits.default_kd,
          limits.max_kp,
          limits.max_kd,
          limits.max_velocity,
          limits.braking,
          limits.max_torque_rate,
          limits.continuous_torque,
          limits.thermal_time,
          plausibility.max_position_rate,
          plausibility.max_velocity_error,
          plausibility.velocity_error_time,
          plausibility.stuck_torque,
          plausibility.stuck_time};
}

[[nodiscard]] JointLimit limit_of_joint(const JointLimitValues& values, std::size_t joint) noexcept;
[[nodiscard]] std::optional<JointLimitProblem> find_problem(const JointLimitValues& values);
[[noreturn]] void throw_problem(const JointLimitProblem& problem);

}  // namespace detail

template <std::size_t N>
[[nodiscard]] JointLimit limit_of_joint(const JointLimits<N>& limits, std::size_t joint) noexcept {
  return detail::limit_of_joint(detail::joint_limit_arrays<detail::JointLimitValues>(limits),
                                joint);
}

/// The first problem of `limits`; nothing if they are valid.
template <std::size_t N>
[[nodiscard]] std::optional<JointLimitProblem> find_problem(const JointLimits<N>& limits) {
  return detail::find_problem(detail::joint_limit_arrays<detail::JointLimitValues>(limits));
}

template <std::size_t N>
void JointLimits<N>::validate() const {
  if (const auto problem = find_problem(*this)) detail::throw_problem(*problem);
}

}  // namespace trifinger
