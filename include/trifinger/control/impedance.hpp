// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "trifinger/control/grasp.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::control {

/// Mass and inertia of a rigid body.
struct RigidBody {
  double mass{0.0};  ///< [kg]
  /// Inertia about the centre of mass, in the body's frame [kg m^2].
  Eigen::Matrix3d inertia{Eigen::Matrix3d::Zero()};
};

/// Mass and inertia of an object whose mass is evenly spread: a box, a stick along x, or a ball.
/// Its size has the whole lengths x, y, z of a box, the length and diameter of a stick, or the
/// diameter of a ball [m].
[[nodiscard]] RigidBody rigid_body(const ObjectDescription& object) noexcept;

/// Standard gravity as in MuJoCo's models [m/s^2], in the world frame.
[[nodiscard]] inline Eigen::Vector3d gravity() noexcept { return {0.0, 0.0, -9.81}; }

/// How stiffly an object is held.
struct ObjectGains {
  double stiffness{100.0};           ///< [N/m]
  double damping{4.0};               ///< [Ns/m]
  double rotational_stiffness{0.1};  ///< [Nm/rad]
  double rotational_damping{0.006};  ///< [Nms/rad]
};

/// The wrench about the object's centre that keeps the object on its way, in the world frame:
///
///     force  = stiffness * dx + damping * dv + mass * (a - gravity)
///     moment = rotational_stiffness * dr + rotational_damping * dw + I alpha + w x I w
///
/// where `dx`, `dv`, `dw` are the errors of position, velocity and angular velocity (desired minus
/// actual), `dr` is the rotation error, and `a`, `alpha`, `w` belong to the desired motion.
[[nodiscard]] Wrench object_impedance(const Motion& desired, const Pose& pose, const Twist& twist,
                                      const RigidBody& body,
                                      const ObjectGains& gains = {}) noexcept;

/// How stiffly a tip is held.
struct TipGains {
  double stiffness{200.0};  ///< [N/m]
  double damping{2.5};      ///< [Ns/m]
};

/// The force that brings a tip to its desired position [N]: `stiffness * dx + damping * dv`. Add
/// the force with which the tip should press. The joint torques for a force are `J' force` plus
/// `Kinematics::bias_torques`.
[[nodiscard]] Eigen::Vector3d tip_impedance(const PointMotion& desired,
                                            const Eigen::Vector3d& position,
                                            const Eigen::Vector3d& velocity,
                                            const TipGains& gains = {}) noexcept;

}  // namespace trifinger::control
