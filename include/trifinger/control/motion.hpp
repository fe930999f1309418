// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <chrono>

/// \file
/// Poses and motions of bodies. All of them are in one frame, by default the world frame.

namespace trifinger::control {

/// A span of time [s]. Types such as `std::chrono::milliseconds` convert implicitly.
using Seconds = std::chrono::duration<double>;

/// Position and orientation of a body.
struct Pose {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< Position of its centre of mass [m].
  /// Rotation from the body's frame: a quaternion w, x, y, z of unit length.
  Eigen::Quaterniond orientation{Eigen::Quaterniond::Identity()};
};

/// Velocity and angular velocity of a body.
struct Twist {
  Eigen::Vector3d linear{Eigen::Vector3d::Zero()};   ///< Velocity of its centre of mass [m/s].
  Eigen::Vector3d angular{Eigen::Vector3d::Zero()};  ///< [rad/s], not in the body's frame.
};

/// Rate of change of a body's twist.
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

/// The rotation about the direction of `vector` by its length [rad]: the exponential map, as a
/// quaternion w, x, y, z.
[[nodiscard]] Eigen::Quaterniond rotation_from_vector(const Eigen::Vector3d& vector) noexcept;

/// The shortest vector [rad] that `rotation_from_vector` turns into `rotation`: the logarithm. Its
/// length is at most pi.
[[nodiscard]] Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& rotation) noexcept;

/// The rotation that still turns `actual` into `desired` [rad], in the frame in which both are
/// given: `log(desired * actual^-1)`.
[[nodiscard]] Eigen::Vector3d rotation_error(const Eigen::Quaterniond& desired,
                                             const Eigen::Quaterniond& actual) noexcept;

/// The pose after moving from `pose` with a constant `twist` for `duration` [s], which may be
/// negative.
[[nodiscard]] Pose moved(const Pose& pose, const Twist& twist, Seconds duration) noexcept;

/// The motion of a point that is fixed to a body. `point` is in the body's frame, from its centre
/// [m].
[[nodiscard]] PointMotion point_of_body(const Motion& body, const Eigen::Vector3d& point) noexcept;

}  // namespace trifinger::control
