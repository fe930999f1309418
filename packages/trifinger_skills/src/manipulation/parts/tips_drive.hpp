// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// Moves the three tips, each on its own, and says where they are and what they feel.
class TipsDrive {
 public:
  using Points = std::array<Eigen::Vector3d, 3>;
  using Motions = std::array<control::PointMotion, 3>;

  TipsDrive(const RobotDescription& description, const control::SafetyLimits& limits,
            const control::TipGains& gains);

  // Takes the measurements of a step. Call it before the other functions.
  void sense(const control::JointState& joints) noexcept;

  [[nodiscard]] const Points& tips() const noexcept { return tips_; }
  [[nodiscard]] const Kinematics& kinematics() const noexcept { return kinematics_; }
  // The force of each tip on its surroundings [N]: what gravity and motion do not explain of the
  // measured torques.
  [[nodiscard]] Eigen::Vector3d felt_force(std::size_t tip) const noexcept;

  // The torques with which the tips follow `motions` and press with `forces` [N]. Gravity, the
  // joints' own motion and the damping of the safety checks are made up for.
  [[nodiscard]] const JointValues& torques(const Motions& motions, const Points& forces) noexcept;
  // Largest torque of the last call, as a share of its limit.
  [[nodiscard]] double torque_share() const noexcept { return share_; }

 private:
  Kinematics kinematics_;
  control::TipGains gains_;
  JointValues safety_damping_;
  JointValues max_torque_;

  control::JointState joints_;
  JointMatrix jacobians_;
  JointValues bias_;
  Points tips_{};
  JointValues tip_velocity_;
  JointValues torques_;
  double share_{0.0};
};

}  // namespace trifinger::manipulation
