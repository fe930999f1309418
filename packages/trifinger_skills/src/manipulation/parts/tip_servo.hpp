// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "trifinger/control/grasp.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// A number of things for each of the three tips.
using TipVectors = std::array<Eigen::Vector3d, control::kContacts>;

// Turns forces and accelerations of tips into torques of joints, and torques into felt forces:
//
//     torque = J' force + M J^-1 (acceleration - dJ/dt dq) + bias + damping dq
//
// where the last term compensates what the safety checks take away. Memory is allocated only during
// construction.
class TipServo {
 public:
  TipServo(const RobotDescription& description, const control::SafetyLimits& limits);

  // Measures where the tips are, and how they move.
  void sense(const control::JointState& joints) noexcept;

  [[nodiscard]] const Eigen::Vector3d& tip(int finger) const noexcept { return at(tips_, finger); }
  [[nodiscard]] const Eigen::Vector3d& velocity(int finger) const noexcept {
    return at(velocities_, finger);
  }
  // How fast a tip turns with its link [rad/s].
  [[nodiscard]] Eigen::Vector3d angular_velocity(int finger) const noexcept {
    return kinematics_.tip_rotation_jacobian(finger) * joint_velocity_;
  }
  // The force with which a tip presses on what it touches [N], as far as the joints feel it.
  [[nodiscard]] const Eigen::Vector3d& felt_force(int finger) const noexcept {
    return at(felt_, finger);
  }

  // The torques for these forces of the tips on their surroundings [N], and these accelerations of
  // the tips [m/s^2].
  [[nodiscard]] const JointValues& torques(const TipVectors& forces,
                                           const TipVectors& accelerations) noexcept;

  // Largest share of a joint's limit in the last torques. The safety checks cut off all above 1.
  [[nodiscard]] double torque_share() const noexcept { return torque_share_; }
  [[nodiscard]] double tip_radius() const noexcept { return radius_; }
  [[nodiscard]] const Kinematics& kinematics() const noexcept { return kinematics_; }

 private:
  static const Eigen::Vector3d& at(const TipVectors& vectors, int finger) noexcept {
    return vectors[static_cast<std::size_t>(finger)];
  }

  Kinematics kinematics_;
  double radius_;
  JointValues damping_;
  JointValues limits_;
  JointValues joint_velocity_;
  JointValues bias_;
  JointMatrix jacobians_;
  std::array<Eigen::Matrix3d, control::kContacts> inverses_;  // Of each finger's own Jacobian.
  TipVectors tips_;
  TipVectors velocities_;
  TipVectors felt_;
  JointValues torques_;
  double torque_share_{0.0};
};

}  // namespace trifinger::manipulation
