// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "trifinger/core/driver.hpp"

namespace trifinger {

/// Where a loose object is, in the world frame: z up, origin on the table.
struct ObjectPose {
  std::array<double, 3> position{};                       ///< Of the centre [m].
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};  ///< Unit quaternion w, x, y, z.

  static constexpr auto fields() {
    return std::tuple{field("position", &ObjectPose::position, "m"),
                      field("orientation", &ObjectPose::orientation)};
  }
};

/// How a loose object moves, in the world frame.
struct ObjectVelocity {
  std::array<double, 3> linear{};   ///< Of the centre [m/s].
  std::array<double, 3> angular{};  ///< About the centre [rad/s].
};

/// An element of the companion "object" of a robot whose one object is called "cube", as the
/// default scene's is.
///
/// With other objects an element has one `ObjectPose` for each of them, under their names and in
/// the order of the scene; a struct like this one reads it.
struct CubeObservation {
  Stamp stamp;
  ObjectPose cube;

  static constexpr auto fields() {
    return std::tuple{field("stamp", &CubeObservation::stamp),
                      field("cube", &CubeObservation::cube)};
  }
};

}  // namespace trifinger
