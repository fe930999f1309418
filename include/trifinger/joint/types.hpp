// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <tuple>

#include "trifinger/core/description.hpp"
#include "trifinger/core/robot.hpp"

namespace trifinger {

/// One number per joint.
template <std::size_t N>
using JointVector = std::array<double, N>;

/// Stands for "not given" in an action.
inline constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();

namespace detail {

template <std::size_t N>
constexpr JointVector<N> filled(double value) {
  JointVector<N> vector{};
  for (double& number : vector) number = value;
  return vector;
}

}  // namespace detail

/// The desired action for N torque-controlled joints. A joint with a position gets, in addition to
/// `torque`,
///
///     position_kp * (position - measured position) - position_kd * measured velocity
///
/// NaN means "not given". A joint without a position gets only its torque, and its gains are
/// ignored. A position without gains uses the robot's own gains. `JointAction{}` asks for no torque
/// at all.
template <std::size_t N>
struct JointAction {
  JointVector<N> torque{};                                   ///< [Nm]
  JointVector<N> position{detail::filled<N>(kNotGiven)};     ///< [rad]
  JointVector<N> position_kp{detail::filled<N>(kNotGiven)};  ///< [Nm/rad]
  JointVector<N> position_kd{detail::filled<N>(kNotGiven)};  ///< [Nms/rad]

  [[nodiscard]] static constexpr JointAction of_torque(const JointVector<N>& torque) noexcept {
    JointAction action;
    action.torque = torque;
    return action;
  }
  /// An action that moves to `position` with the robot's own gains.
  [[nodiscard]] static constexpr JointAction of_position(const JointVector<N>& position) noexcept {
    JointAction action;
    action.position = position;
    return action;
  }

  static constexpr auto fields() {
    return std::tuple{field("torque", &JointAction::torque, "Nm"),
                      field("position", &JointAction::position, "rad"),
                      field("position_kp", &JointAction::position_kp, "Nm/rad"),
                      field("position_kd", &JointAction::position_kd, "Nms/rad")};
  }
};

/// The measurements of N joints and of `Tips` tips that measure force.
template <std::size_t N, std::size_t Tips = 0>
struct JointObservation {
  JointVector<N> position{};  ///< [rad]
  JointVector<N> velocity{};  ///< [rad/s]
  JointVector<N> torque{};    ///< Torque of the previous period [Nm].
  std::array<double, Tips>
      tip_force{};  ///< Force along the pressing direction, of the previous period [N].

  static constexpr auto fields() {
    return std::tuple{field("position", &JointObservation::position, "rad"),
                      field("velocity", &JointObservation::velocity, "rad/s"),
                      field("torque", &JointObservation::torque, "Nm"),
                      field("tip_force", &JointObservation::tip_force, "N")};
  }
};

template <std::size_t N>
struct JointObservation<N, 0> {
  JointVector<N> position{};  ///< [rad]
  JointVector<N> velocity{};  ///< [rad/s]
  JointVector<N> torque{};    ///< Torque of the previous period [Nm].

  static constexpr auto fields() {
    return std::tuple{field("position", &JointObservation::position, "rad"),
                      field("velocity", &JointObservation::velocity, "rad/s"),
                      field("torque", &JointObservation::torque, "Nm")};
  }
};

/// The action that was applied instead of a desired action, and the reasons for any difference.
///
/// `reasons` of a joint is zero exactly if the joint got what was asked for: its torque plus the PD
/// of its position, with the given gains or, if none were given, the robot's own. In the step of a
/// fault every joint has a reason.
///
/// `thermal_margin` of a joint is 1 for a cold motor. It falls to 0 for a motor at the temperature
/// that its continuous torque leads to. Below 0.2 the torque is limited. Values are multiples of
/// 1/256, rounded down.
template <std::size_t N>
struct AppliedJointAction {
  JointVector<N> torque{};  ///< Whole torque of the motor, including PD [Nm].
  JointVector<N> position{detail::filled<N>(kNotGiven)};  ///< Target in use; NaN without one [rad].
  JointVector<N> position_kp{detail::filled<N>(kNotGiven)};  ///< NaN without a target [Nm/rad].
  JointVector<N> position_kd{detail::filled<N>(kNotGiven)};  ///< NaN without a target [Nms/rad].
  std::array<std::uint64_t, N> reasons{};                    ///< Bits of `Reason`.
  JointVector<N> thermal_margin{detail::filled<N>(1.0)};     ///< [1]

  static constexpr auto fields() {
    return std::tuple{field("torque", &AppliedJointAction::torque, "Nm"),
                      field("position", &AppliedJointAction::position, "rad"),
                      field("position_kp", &AppliedJointAction::position_kp, "Nm/rad"),
                      field("position_kd", &AppliedJointAction::position_kd, "Nms/rad"),
                      field("reasons", &AppliedJointAction::reasons),
                      field("thermal_margin", &AppliedJointAction::thermal_margin)};
  }
};

/// The action that keeps the measured pose with the robot's own gains. To hold still, keep using
/// one such action. If it is made anew in every step, it follows the pose as the robot sags.
template <std::size_t N, std::size_t Tips>
[[nodiscard]] constexpr JointAction<N> hold_position(
    const JointObservation<N, Tips>& observation) noexcept {
  return JointAction<N>::of_position(observation.position);
}

/// The types of a robot with N joints and `Tips` tips. A robot derives from this struct and adds
/// its name, `kType`.
template <std::size_t N, std::size_t Tips = 0>
struct JointRobot {
  static constexpr std::size_t kJoints = N;
  static constexpr std::size_t kTips = Tips;

  using Action = JointAction<N>;
  using Observation = JointObservation<N, Tips>;
  using AppliedAction = AppliedJointAction<N>;
};

/// Three fingers of three joints: finger 0, 120, 240, from the base to the tip.
struct TriFinger : JointRobot<9, 3> {
  static constexpr std::string_view kType = "trifinger";
};

/// One finger of three joints.
struct Finger : JointRobot<3, 1> {
  static constexpr std::string_view kType = "finger";
};

static_assert(Robot<TriFinger> && Robot<Finger>);

}  // namespace trifinger
