// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/base/time.hpp"

namespace trifinger {

/// How one simulated robot differs from its description: what nobody knows exactly of a real one.
struct Variation {
  static constexpr TimeIndex kMaxTorqueDelay = 10;

  double object_mass{1.0};  ///< Of every object, with its inertia: times its own, more than 0.
  double friction{1.0};     ///< Sliding friction of every surface: times its own, at least 0.
  double motor_gain{1.0};   ///< What motors deliver of a torque; more than 0. They do not feel it.
  TimeIndex torque_delay{0};  ///< Steps until the motors deliver it, up to `kMaxTorqueDelay`.

  /// @throws InvalidArgument naming the value found and those allowed
  void validate() const;

  friend bool operator==(const Variation&, const Variation&) = default;
};

}  // namespace trifinger
