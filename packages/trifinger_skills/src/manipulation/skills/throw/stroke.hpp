// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger::manipulation {

using control::Seconds;

// A fast motion of all joints that was found or recorded in advance: targets at even times, with
// straight lines between them.
struct Stroke {
  Seconds spacing;                   // From one target to the next.
  std::vector<JointValues> targets;  // [rad]; the first is where the stroke begins.
  double stiffness;                  // Of the joints about their targets [Nm/rad].
  double damping;                    // Of the joints about the targets' velocity [Nms/rad].

  // Time from the first target to the last.
  [[nodiscard]] Seconds duration() const noexcept {
    return spacing * static_cast<double>(targets.empty() ? 0 : targets.size() - 1);
  }
};

// The targets of a stroke at one instant.
struct StrokeTargets {
  JointValues position;  // [rad]
  JointValues velocity;  // [rad/s]
};

// The targets at `time` since the stroke began. Before that time the joints rest at the first
// target, after its duration at the last one.
[[nodiscard]] StrokeTargets targets_at(const Stroke& stroke, Seconds time) noexcept;

// The action that follows `targets`. The robot adds the stiffness itself. The torque is
// `(damping + safety_kd) * velocity`: it makes up for the damping of the targets' own motion, that
// of the stroke and that of the safety checks. `torque` is added [Nm].
void follow(const Stroke& stroke, const StrokeTargets& targets, const control::SafetyLimits& limits,
            const JointValues& torque, TriFinger::Action& action) noexcept;

// From the end of a stroke on the ball still touches a tip.
inline constexpr Seconds kReleaseTime{0.02};

// The action after a stroke, when the joints were at `position`. Upper and middle links are damped
// as hard as they can be: at the stroke's own stiffness they would swing. `torque` is added [Nm].
void brake(const JointValues& position, const control::SafetyLimits& limits,
           const JointValues& torque, TriFinger::Action& action) noexcept;

// Throws InvalidArgument that names the first value that makes no sense.
void validate(const Stroke& stroke, const control::SafetyLimits& limits);

}  // namespace trifinger::manipulation
