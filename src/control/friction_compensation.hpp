// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/time.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::control {

// Learns the dry (Coulomb) friction of joints while they move freely, and makes up for it along the
// motion that is wanted: a sign of measured velocities would tremble where a joint turns round.
// One number for all joints, which have equal motors and bearings: errors of single motors and of
// the weights of links have both signs and cancel out.
class FrictionCompensation {
 public:
  // Torques that take what friction takes from joints that should move with `rates` [rad/s].
  // `pushed` are the torques of feedback beside the model [Nm]. If the joints move freely, they say
  // what friction still takes.
  [[nodiscard]] JointValues torques(const JointValues& rates, const JointValues& pushed,
                                    bool are_free, Seconds elapsed) noexcept;

  // What is known of the friction of a joint [Nm].
  [[nodiscard]] double friction() const noexcept { return friction_; }

 private:
  double friction_{0.0};
};

}  // namespace trifinger::control
