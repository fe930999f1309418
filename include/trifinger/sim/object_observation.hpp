// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "trifinger/core/driver.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger {

class SceneModel;

/// Pose of a loose object in the world frame: z up, origin on the table.
struct ObjectPose {
  std::array<double, 3> position{};                       ///< Position of the centre [m].
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};  ///< Unit quaternion w, x, y, z.

  static constexpr auto fields() {
    return std::tuple{field("position", &ObjectPose::position, "m"),
                      field("orientation", &ObjectPose::orientation)};
  }
};

/// Velocity of a loose object in the world frame.
struct ObjectVelocity {
  std::array<double, 3> linear{};   ///< Velocity of the centre [m/s].
  std::array<double, 3> angular{};  ///< Angular velocity [rad/s].
};

/// An element of the companion "object" of a robot whose only object is called "cube", as in the
/// default scene.
///
/// With other objects an element has one `ObjectPose` per object, under the objects' names and in
/// the order of the scene. A struct like this one reads it.
struct CubeObservation {
  Stamp stamp;
  ObjectPose cube;

  static constexpr auto fields() {
    return std::tuple{field("stamp", &CubeObservation::stamp),
                      field("cube", &CubeObservation::cube)};
  }
};

/// Name of the companion with the poses of the objects.
inline constexpr const char* kObjectCompanion = "object";

/// Describes the companion "object" of a robot: one pose for each of these objects, in their order.
/// Nothing if there are none.
[[nodiscard]] std::optional<CompanionDescription> object_companion(
    std::span<const std::string> names);
[[nodiscard]] std::optional<CompanionDescription> object_companion(
    std::span<const ObjectDescription> objects);
/// The same for all objects of a model, in its order.
[[nodiscard]] std::optional<CompanionDescription> object_companion(const SceneModel& model);

/// Writes an element of that companion.
void write_objects(const Stamp& stamp, std::span<const ObjectPose> objects,
                   std::byte* element) noexcept;

}  // namespace trifinger
