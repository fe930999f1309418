// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <chrono>

/// \file
/// Where bodies are and how they move. All of it is in one frame, by default the world's.

namespace trifinger::control {

/// A span of time [s]. `std::chrono::milliseconds(10)` and the like convert by themselves.
using Seconds = std::chrono::duration<double>;

/// Where a body is and how it is turned.
struct Pose {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< Of its centre of mass [m].
  /// From the body's frame; of unit length.
  Eigen::Quaterniond orientation{Eigen::Quaterniond::Identity()};
};

/// How a body moves.
struct Twist {
  Eigen::Vector3d linear{Eigen::Vector3d::Zero()};   ///< Of its centre of mass [m/s].
  Eigen::Vector3d angular{Eigen::Vector3d::Zero()};  ///< [rad/s], not in the body's frame.
};

/// How the twist of a body changes.
struct Acceleration {
  Eigen::Vector3d linear{Eigen::Vector3d::Zero()};   ///< [m/s^2]
  Eigen::Vector3d angular{Eigen::Vector3d::Zero()};  ///< [rad/s^2]
};

/// A body at one instant of a motion.
struct Motion {
  Pose pose{};
  Twist twist{};
  Acceleration acceleration{};
};

/// A point at one instant of a motion.
struct PointMotion {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};      ///< [m]
  Eigen::Vector3d velocity{Eigen::Vector3d::Zero()};      ///< [m/s]
  Eigen::Vector3d acceleration{Eigen::Vector3d::Zero()};  ///< [m/s^2]
};

/// The rotation by `vector` [rad], about its direction and by its length: the exponential map.
[[nodiscard]] Eigen::Quaterniond rotation_from_vector(const Eigen::Vector3d& vector) noexcept;

/// The shortest vector that `rotation_from_vector` makes `rotation` of [rad]: the logarithm. Its
/// length is pi at most.
[[nodiscard]] Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& rotation) noexcept;

/// By what `actual` must still be turned to become `desired` [rad], in the frame in which both are
/// given: `log(desired * actual^-1)`.
[[nodiscard]] Eigen::Vector3d rotation_error(const Eigen::Quaterniond& desired,
                                             const Eigen::Quaterniond& actual) noexcept;

/// Where `pose` is after moving with a constant `twist` for `duration`, which may be negative.
[[nodiscard]] Pose moved(const Pose& pose, const Twist& twist, Seconds duration) noexcept;

/// How a point moves that is fixed to a body; `point` is in the body's frame, from its centre [m].
[[nodiscard]] PointMotion point_of_body(const Motion& body, const Eigen::Vector3d& point) noexcept;

}  // namespace trifinger::control
