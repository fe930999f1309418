// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/skill_trial.hpp"
#include "manipulation/taught_motion.hpp"

namespace trifinger::evaluation {

// How hands lead the tips of a robot that floats.
struct Hands {
  double stiffness{800.0};  // Of the spring between a hand and its tip [N/m].
  double damping{4.0};      // [Ns/m]
};

// Teaches a skill in the simulation of `trial`, without any variation. It is shown once by its
// controller. Then the robot floats, and a spring at each tip leads it: a hand goes where the tip
// was shown to be, ahead of it by the force that the tip needs. Returns what the joints did, and
// the torques of the springs.
[[nodiscard]] manipulation::TaughtMotion taught(const SkillTrial& trial, const Hands& hands,
                                                control::Seconds interval);

}  // namespace trifinger::evaluation
