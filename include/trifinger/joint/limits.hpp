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

/// What the joints of a robot may do. There are no defaults: a limit that was forgotten must not be
/// a guess.
template <std::size_t N>
struct JointLimits {
  JointVector<N> max_torque;  ///< More than 0 [Nm].
  JointVector<N> safety_kd;   ///< Damping that always acts, at least 0 [Nms/rad].
  JointVector<N> soft_lower;  ///< Targets are clamped and the joint is pushed back [rad].
  JointVector<N> soft_upper;  ///< [rad]
  JointVector<N>
      hard_lower;  ///< Beyond it the robot stops with a fault; not inside the soft limit [rad].
  JointVector<N> hard_upper;  ///< [rad]
  JointVector<N> default_kp;  ///< Gains of a position that comes without its own [Nm/rad].
  JointVector<N> default_kd;  ///< [Nms/rad]
  JointVector<N> max_kp;      ///< Largest gains that a user may ask for [Nm/rad].
  JointVector<N> max_kd;      ///< [Nms/rad]

  /// @throws InvalidArgument naming the joint, the value found and the value allowed.
  void validate() const;
};

/// A limit that makes no sense.
struct JointLimitProblem {
  std::size_t joint{0};
  std::string_view field;  ///< As in "soft_lower".
  std::string text;        ///< "is 1.2 rad, must be less than soft_upper (0.5 rad)"
};

namespace detail {

// The ten arrays of JointLimits in the order of their declaration.
struct JointLimitField {
  std::string_view name;
  std::string_view unit;
};
inline constexpr std::size_t kJointLimitFields = 10;
[[nodiscard]] std::span<const JointLimitField, kJointLimitFields> joint_limit_fields() noexcept;

using JointLimitValues = std::array<std::span<const double>, kJointLimitFields>;

template <std::size_t N>
[[nodiscard]] JointLimitValues joint_limit_values(const JointLimits<N>& limits) noexcept {
  return {limits.max_torque, limits.safety_kd,  limits.soft_lower, limits.soft_upper,
          limits.hard_lower, limits.hard_upper, limits.default_kp, limits.default_kd,
          limits.max_kp,     limits.max_kd};
}

[[nodiscard]] std::optional<JointLimitProblem> find_problem(const JointLimitValues& values);
[[noreturn]] void throw_problem(const JointLimitProblem& problem);

}  // namespace detail

/// The first thing that is wrong with `limits`, if anything is.
template <std::size_t N>
[[nodiscard]] std::optional<JointLimitProblem> find_problem(const JointLimits<N>& limits) {
  return detail::find_problem(detail::joint_limit_values(limits));
}

template <std::size_t N>
void JointLimits<N>::validate() const {
  if (const auto problem = find_problem(*this)) detail::throw_problem(*problem);
}

}  // namespace trifinger
