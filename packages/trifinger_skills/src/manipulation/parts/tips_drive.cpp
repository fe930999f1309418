// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/tips_drive.hpp"

#include <cstddef>

namespace trifinger::manipulation {

TipsDrive::TipsDrive(const RobotDescription& description, const control::SafetyLimits& limits,
                     const control::TipGains& gains)
    : servo_(description, limits),
      gains_(gains),
      max_torque_(JointValues::Map(limits.max_torque.data(), kMaxJoints)),
      torques_(JointValues::Zero(kMaxJoints)) {}

const JointValues& TipsDrive::torques(const Motions& motions, const TipVectors& forces,
                                      bool are_free, control::Seconds elapsed) noexcept {
  TipsCommand command{.forces = forces, .are_free = are_free};
  for (int i = 0; i < control::kContacts; ++i) {
    const auto k = static_cast<std::size_t>(i);
    command.forces[k] +=
        control::tip_impedance(motions[k], servo_.tip(i), servo_.velocity(i), gains_);
    command.velocities[k] = motions[k].velocity;
    command.accelerations[k] = motions[k].acceleration;
  }
  // Near a stretched finger the inverse is large, and a torque without bounds helps nobody.
  torques_ = servo_.torques(command, elapsed).cwiseMax(-max_torque_).cwiseMin(max_torque_);
  return torques_;
}

}  // namespace trifinger::manipulation
