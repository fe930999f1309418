// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "control/friction_compensation.hpp"
#include "trifinger/control/grasp.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// A number of things for each of the three tips.
using TipVectors = std::array<Eigen::Vector3d, control::kContacts>;

// What the three tips should do in a step.
struct TipsCommand {
  TipVectors forces = zeros();         // On their surroundings [N].
  TipVectors velocities = zeros();     // [m/s]
  TipVectors accelerations = zeros();  // [m/s^2]
  bool are_free{false};                // They touch nothing.

  [[nodiscard]] static TipVectors zeros() noexcept {
    return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  }
};

// Turns forces and accelerations of tips into torques of joints, and torques into felt forces:
//
//     torque = J' force + M J^-1 (acceleration - dJ/dt dq) + bias + damping dq + friction
//
// where damping compensates what the safety checks take away, and friction what joints take that
// should move. Memory is allocated only during construction.
class TipServo {
 public:
  TipServo(const RobotDescription& description, const control::SafetyLimits& limits);

  // Measures where the tips are, and how they move.
  void sense(const control::JointState& joints) noexcept;

  [[nodiscard]] const Eigen::Vector3d& tip(int finger) const noexcept { return at(tips_, finger); }
  [[nodiscard]] const TipVectors& tips() const noexcept { return tips_; }
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

  // The torques for the command of a step that is `elapsed` after the last one.
  [[nodiscard]] const JointValues& torques(const TipsCommand& command,
                                           control::Seconds elapsed) noexcept;

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
  control::FrictionCompensation friction_;
  JointValues torques_;
  double torque_share_{0.0};
};

}  // namespace trifinger::manipulation
