// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>

#include "manipulation/parts/tip_servo.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::manipulation {

// Moves the three tips, each on its own along a motion.
class TipsDrive {
 public:
  using Motions = std::array<control::PointMotion, control::kContacts>;

  TipsDrive(const RobotDescription& description, const control::SafetyLimits& limits,
            const control::TipGains& gains);

  // Takes the measurements of a step. Call it before the other functions.
  void sense(const control::JointState& joints) noexcept { servo_.sense(joints); }

  [[nodiscard]] const TipVectors& tips() const noexcept { return servo_.tips(); }
  [[nodiscard]] const Kinematics& kinematics() const noexcept { return servo_.kinematics(); }

  // The torques with which the tips follow `motions` and press with `forces` [N]; see TipServo.
  [[nodiscard]] const JointValues& torques(const Motions& motions, const TipVectors& forces,
                                           bool are_free, control::Seconds elapsed) noexcept;
  // Largest torque of the last call, as a share of its limit.
  [[nodiscard]] double torque_share() const noexcept {
    return std::min(servo_.torque_share(), 1.0);
  }

 private:
  TipServo servo_;
  control::TipGains gains_;
  JointValues max_torque_;
  JointValues torques_;
};

}  // namespace trifinger::manipulation
