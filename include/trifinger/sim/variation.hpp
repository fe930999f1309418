// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger {

/// How one simulated robot differs from its description: what nobody knows exactly of a real one.
struct Variation {
  static constexpr TimeIndex kMaxTorqueDelay = 10;

  double object_mass{1.0};  ///< Of every object, with its inertia: times its own, more than 0.
  double friction{1.0};     ///< Sliding friction of every surface: times its own, at least 0.
  /// Between two kinds of surfaces, besides: times its own, at least 0.
  OfSurfacePairs<double> pair_friction = OfSurfacePairs<double>::all(1.0);
  double contact_time{1.0};  ///< Time constants of all contacts: times their own, more than 0.
  double motor_gain{1.0};    ///< What motors deliver of a torque; more than 0. They do not feel it.
  TimeIndex torque_delay{0};   ///< Steps until the motors deliver it, up to `kMaxTorqueDelay`.
  double rotor_inertia{1.0};   ///< Of every motor: times its own, at least 0.
  double joint_damping{1.0};   ///< Of every joint, but for the safety layer's: at least 0.
  double joint_friction{0.0};  ///< Dry friction of every joint, on top of its own: at least 0 [Nm].
  double stop_margin{1.0};     ///< From hard limits to mechanical stops: times its own, at least 0.

  /// @throws InvalidArgument naming the value found and those allowed
  void validate() const;

  friend bool operator==(const Variation&, const Variation&) = default;
};

}  // namespace trifinger
