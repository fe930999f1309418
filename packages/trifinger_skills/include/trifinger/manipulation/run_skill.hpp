// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <functional>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/manipulation/skill.hpp"
#include "trifinger/model/identified.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::manipulation {

/// Settings and observers of a skill that runs.
struct SkillRunOptions {
  /// What the calling thread requests from the machine. Applied before the first action.
  RealtimeOptions realtime{.demand = Demand::kOff};
  /// A signal handler or another thread sets this: the skill is stopped, then the run ends.
  const std::atomic<bool>* stop{nullptr};
  /// What was measured on this robot's joints: the skill sees positions without zero offsets, and
  /// its torques are those that act. The rest does not count.
  Identified identified{};
  /// Called in every step when its observation has arrived.
  std::function<void(TimeIndex step)> on_step{};
  /// Called in every step when its action is known.
  std::function<void(const SkillStep& step)> on_update{};
  /// Called when another phase begins.
  std::function<void(const Skill& skill)> on_phase{};
  /// Called when the object is no longer visible, and when it is visible again.
  std::function<void(const Skill& skill)> on_visibility{};
};

/// The robot and its limits, as the configuration in its session says.
/// @throws InvalidArgument if the session has none or if the robot has not three fingers
[[nodiscard]] SkillContext context_of(const Session& session);

/// Carries out `skill` on `robot` and ends the session. Nobody may have driven the robot in this
/// session before. The same code drives a robot in real time and a simulation that waits.
///
/// The object's pose comes from the companion "object". In real-time mode another thread makes the
/// plans. Otherwise the robot waits for them, so that the same robot gives the same series bit for
/// bit. Between its plans the loop allocates no memory.
/// @throws RobotStopped, IncompatibleSession if nobody says where the skill's object is
[[nodiscard]] SkillTrace run_skill(Frontend<TriFinger>& robot, Skill& skill,
                                   const SkillRunOptions& options = {});

}  // namespace trifinger::manipulation
