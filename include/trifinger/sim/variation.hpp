// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <tuple>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger {

struct Variation;

/// A row of `Variation::fields()`.
template <class T>
struct VariationField {
  const char* name;
  T Variation::* value;
  bool may_be_zero{true};  ///< No value may be below 0.
  /// Every value must be below this one.
  double limit{std::numeric_limits<double>::infinity()};
};

/// How one simulated robot differs from its description, for what nobody knows exactly about a real
/// robot.
struct Variation {
  static constexpr TimeIndex kMaxDelay = 10;

  double object_mass{1.0};  ///< Factor on mass and inertia of every object, more than 0.
  double friction{1.0};     ///< Factor on the sliding friction of every surface, at least 0.
  /// Additional factor on the friction between two kinds of surfaces, at least 0.
  OfSurfacePairs<double> pair_friction = OfSurfacePairs<double>::all(1.0);
  double contact_time{1.0};    ///< Factor on the time constants of all contacts, more than 0.
  double motor_gain{1.0};      ///< Factor on delivered torques, above 0; measured torques omit it.
  TimeIndex torque_delay{0};   ///< Steps until motors deliver a torque, up to `kMaxDelay`.
  double rotor_inertia{1.0};   ///< Factor on the inertia of every rotor, at least 0.
  double joint_damping{1.0};   ///< Factor on every joint's own damping, at least 0.
  double joint_friction{0.0};  ///< Dry friction added to every joint's own, at least 0 [Nm].
  double stop_margin{1.0};     ///< Factor on the distance from hard limits to stops, at least 0.
  /// @name What differs from joint to joint; `seed` decides how
  /// @{
  double homing_error{0.0};   ///< The largest error of the zero of a joint's encoder [rad], [m].
  double motor_spread{0.0};   ///< By which share `motor_gain` of a motor differs at most, below 1.
  double torque_ripple{0.0};  ///< Share of the torque that comes and goes as a motor turns.
  std::uint64_t seed{0};
  /// @}
  /// Play between each motor, which has the encoder, and its joint [rad], [m].
  double backlash{0.0};
  TimeIndex measurement_delay{0};  ///< Steps by which positions and velocities are old.
  double velocity_noise{0.0};      ///< Standard deviation of noise on velocities [rad/s], [m/s].
  double motor_heat{0.0};  ///< Heat of every motor after a reset, below 1; see `JointLimit`.
  double tip_radius{1.0};  ///< Factor on the radius of every tip, more than 0.

  /// One row for each value. Checking and Python loop over them.
  [[nodiscard]] static constexpr auto fields() noexcept {
    using Number = VariationField<double>;
    return std::tuple{
        Number{"object_mass", &Variation::object_mass, false},
        Number{"friction", &Variation::friction},
        VariationField<OfSurfacePairs<double>>{"pair_friction", &Variation::pair_friction},
        Number{"contact_time", &Variation::contact_time, false},
        Number{"motor_gain", &Variation::motor_gain, false},
        VariationField<TimeIndex>{"torque_delay", &Variation::torque_delay},
        Number{"rotor_inertia", &Variation::rotor_inertia},
        Number{"joint_damping", &Variation::joint_damping},
        Number{"joint_friction", &Variation::joint_friction},
        Number{"stop_margin", &Variation::stop_margin},
        Number{"homing_error", &Variation::homing_error},
        Number{"motor_spread", &Variation::motor_spread, true, 1.0},
        Number{"torque_ripple", &Variation::torque_ripple, true, 1.0},
        VariationField<std::uint64_t>{"seed", &Variation::seed},
        Number{"backlash", &Variation::backlash},
        VariationField<TimeIndex>{"measurement_delay", &Variation::measurement_delay},
        Number{"velocity_noise", &Variation::velocity_noise},
        Number{"motor_heat", &Variation::motor_heat, true, 1.0},
        Number{"tip_radius", &Variation::tip_radius, false}};
  }

  /// @throws InvalidArgument that names the value found and the values allowed
  void validate() const;

  /// True if this pair of surfaces has a friction of its own.
  [[nodiscard]] bool varies(SurfacePair pair) const noexcept { return pair_friction[pair] != 1.0; }
  /// True if the same pairs have a friction of their own in `other`. A model made for one of the
  /// two then serves both.
  [[nodiscard]] bool varies_same_pairs_as(const Variation& other) const noexcept;

  friend bool operator==(const Variation&, const Variation&) = default;
};

}  // namespace trifinger
