// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger {

/// How one simulated robot differs from its description, for what nobody knows exactly about a real
/// robot.
struct Variation {
  static constexpr TimeIndex kMaxTorqueDelay = 10;

  double object_mass{1.0};  ///< Factor on mass and inertia of every object, more than 0.
  double friction{1.0};     ///< Factor on the sliding friction of every surface, at least 0.
  /// Additional factor on the friction between two kinds of surfaces, at least 0.
  OfSurfacePairs<double> pair_friction = OfSurfacePairs<double>::all(1.0);
  double contact_time{1.0};    ///< Factor on the time constants of all contacts, more than 0.
  double motor_gain{1.0};      ///< Factor on delivered torques, above 0; measured torques omit it.
  TimeIndex torque_delay{0};   ///< Steps until motors deliver a torque, up to `kMaxTorqueDelay`.
  double rotor_inertia{1.0};   ///< Factor on the inertia of every rotor, at least 0.
  double joint_damping{1.0};   ///< Factor on every joint's own damping, at least 0.
  double joint_friction{0.0};  ///< Dry friction added to every joint's own, at least 0 [Nm].
  double stop_margin{1.0};     ///< Factor on the distance from hard limits to stops, at least 0.

  /// @throws InvalidArgument that names the value found and the values allowed
  void validate() const;

  friend bool operator==(const Variation&, const Variation&) = default;
};

}  // namespace trifinger
