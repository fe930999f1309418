// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "trifinger/base/error.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger {

struct JointLimitField;

/// What one joint may do. A value that nobody has set is NaN, which `validate` refuses: a limit
/// that was forgotten must not be a guess.
struct JointLimit {
  double max_torque{kNotGiven};    ///< Largest torque of the cold motor [Nm].
  double safety_kd{kNotGiven};     ///< Damping that always acts [Nms/rad].
  double soft_lower{kNotGiven};    ///< Targets are clamped; a joint beyond is pushed back [rad].
  double soft_upper{kNotGiven};    ///< Upper soft limit [rad].
  double hard_lower{kNotGiven};    ///< Beyond it the robot stops with a fault [rad].
  double hard_upper{kNotGiven};    ///< Upper hard limit [rad].
  double default_kp{kNotGiven};    ///< Stiffness of a position that comes without its own [Nm/rad].
  double default_kd{kNotGiven};    ///< Damping of a position that comes without its own [Nms/rad].
  double max_kp{kNotGiven};        ///< Largest stiffness that a user may ask for [Nm/rad].
  double max_kd{kNotGiven};        ///< Largest damping that a user may ask for [Nms/rad].
  double max_velocity{kNotGiven};  ///< A faster joint is not driven, but braked [rad/s].
  double braking{kNotGiven};  ///< Deceleration that must suffice to stop at a soft limit [rad/s^2].
  double max_torque_rate{kNotGiven};      ///< Largest change of the torque asked for [Nm/s].
  double continuous_torque{kNotGiven};    ///< Torque that the motor carries for ever [Nm].
  double thermal_time{kNotGiven};         ///< Time constant of the motor's warming [s].
  double max_position_rate{kNotGiven};    ///< A position that changes faster has jumped [rad/s].
  double max_velocity_error{kNotGiven};   ///< Velocity against change of position [rad/s].
  double velocity_error_time{kNotGiven};  ///< Time constant of that filter [s].
  double stuck_torque{kNotGiven};         ///< While the torque changes by this much [Nm], ...
  double stuck_time{kNotGiven};  ///< ... a joint that stays still for so long is stuck [s].

  /// One row for each value: name, unit and what is allowed. Reading and checking loop over them.
  [[nodiscard]] static constexpr std::span<const JointLimitField> fields() noexcept;
};

/// A row of `JointLimit::fields()`.
struct JointLimitField {
  /// The values that make sense. None may be beyond `kLargestJointLimit`.
  enum class Allowed : std::uint8_t {
    kAny,
    kNotNegative,
    kPositive,
    kPositiveOrInfinite,  ///< Infinity, `.inf` in a configuration, switches the limit off.
  };
  using enum Allowed;

  double JointLimit::* value;
  std::string_view name;  ///< Its key in the section `safety`; "plausibility.x" is one deeper.
  std::string_view unit;
  Allowed allowed;
  /// The value of all robots here, for programs without a configuration. NaN: each has its own.
  double usual{kNotGiven};

  [[nodiscard]] constexpr bool may_be_infinite() const noexcept {
    return allowed == kPositiveOrInfinite;
  }
};

/// Bound of limits. With plausible measurements (at most 1e6, too) no product or sum in the checks
/// can overflow.
inline constexpr double kLargestJointLimit = 1e6;

namespace detail {

inline constexpr double kNoLimit = std::numeric_limits<double>::infinity();
inline constexpr std::array kJointLimitFields = std::to_array<JointLimitField>({
    {&JointLimit::max_torque, "max_torque", "Nm", JointLimitField::kPositive},
    {&JointLimit::safety_kd, "safety_kd", "Nms/rad", JointLimitField::kNotNegative},
    {&JointLimit::soft_lower, "soft_lower", "rad", JointLimitField::kAny},
    {&JointLimit::soft_upper, "soft_upper", "rad", JointLimitField::kAny},
    {&JointLimit::hard_lower, "hard_lower", "rad", JointLimitField::kAny},
    {&JointLimit::hard_upper, "hard_upper", "rad", JointLimitField::kAny},
    {&JointLimit::default_kp, "default_kp", "Nm/rad", JointLimitField::kNotNegative},
    {&JointLimit::default_kd, "default_kd", "Nms/rad", JointLimitField::kNotNegative},
    // No source has bounds for gains. These are well inside the stable range at 1 kHz for the
    // lightest link.
    {&JointLimit::max_kp, "max_kp", "Nm/rad", JointLimitField::kNotNegative, 50.0},
    {&JointLimit::max_kd, "max_kd", "Nms/rad", JointLimitField::kNotNegative, 0.5},
    {&JointLimit::max_velocity, "max_velocity", "rad/s", JointLimitField::kPositiveOrInfinite},
    {&JointLimit::braking, "braking", "rad/s^2", JointLimitField::kPositiveOrInfinite},
    {&JointLimit::max_torque_rate, "max_torque_rate", "Nm/s", JointLimitField::kPositiveOrInfinite,
     kNoLimit},
    {&JointLimit::continuous_torque, "continuous_torque", "Nm",
     JointLimitField::kPositiveOrInfinite},
    {&JointLimit::thermal_time, "thermal_time", "s", JointLimitField::kPositiveOrInfinite},
    // What a motor without load reaches, plus half of that for impacts on the arm.
    {&JointLimit::max_position_rate, "plausibility.max_position_rate", "rad/s",
     JointLimitField::kPositiveOrInfinite, 65.0},
    // A velocity that is wrong by 1 rad/s for a tenth of a second, or a joint that stays exactly
    // the same for as long.
    {&JointLimit::max_velocity_error, "plausibility.max_velocity_error", "rad/s",
     JointLimitField::kPositiveOrInfinite, 1.0},
    {&JointLimit::velocity_error_time, "plausibility.velocity_error_time", "s",
     JointLimitField::kPositiveOrInfinite, 0.1},
    {&JointLimit::stuck_torque, "plausibility.stuck_torque", "Nm",
     JointLimitField::kPositiveOrInfinite},
    {&JointLimit::stuck_time, "plausibility.stuck_time", "s", JointLimitField::kPositiveOrInfinite,
     0.1},
});
static_assert(kJointLimitFields.size() * sizeof(double) == sizeof(JointLimit),
              "every value of JointLimit has one row");

}  // namespace detail

namespace detail {

// Throws InvalidArgument if a robot has another number of joints.
void require_count(std::size_t found, std::size_t expected);

}  // namespace detail

constexpr std::span<const JointLimitField> JointLimit::fields() noexcept {
  return detail::kJointLimitFields;
}

/// The limits of N joints.
template <std::size_t N>
using JointLimits = std::array<JointLimit, N>;

/// Copies limits to an array, for a program that knows how many joints its robot has.
/// @throws InvalidArgument if there are more or fewer
template <std::size_t N>
[[nodiscard]] JointLimits<N> limits_of(std::span<const JointLimit> limits) {
  detail::require_count(limits.size(), N);
  JointLimits<N> result;
  std::copy_n(limits.begin(), N, result.begin());
  return result;
}

/// A limit that makes no sense.
struct JointLimitProblem {
  std::size_t joint{0};
  std::string_view
      field;         ///< Name of the field, as in "soft_lower" or "plausibility.stuck_torque".
  std::string text;  ///< "is 1.2 rad, must be less than soft_upper (0.5 rad)"
};

/// Finds the first limit that makes no sense, if there is one.
[[nodiscard]] std::optional<JointLimitProblem> find_problem(std::span<const JointLimit> limits);

/// Refuses limits that make no sense.
/// @throws InvalidArgument naming the joint, the value found and the value allowed.
void validate(std::span<const JointLimit> limits);

/// One value of all joints, as in `values_of(limits, &JointLimit::soft_lower)`.
template <std::size_t N>
[[nodiscard]] constexpr JointVector<N> values_of(const JointLimits<N>& limits,
                                                 double JointLimit::* value) noexcept {
  JointVector<N> values{};
  for (std::size_t i = 0; i < N; ++i) values[i] = limits[i].*value;
  return values;
}

}  // namespace trifinger
