// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::apps {

// Recorded actions that a robot should repeat, and the pose in which they began.
struct Motion {
  RobotTypes types;
  std::vector<std::byte> actions;
  std::vector<std::byte> observations;  // one per action
  TimeIndex first{0};                   // first step in the log

  [[nodiscard]] TimeIndex steps() const noexcept {
    return static_cast<TimeIndex>(actions.size() / types.action.size());
  }
  [[nodiscard]] std::byte* action(TimeIndex t) noexcept {
    return actions.data() + static_cast<std::size_t>(t) * types.action.size();
  }
  [[nodiscard]] const std::byte* action(TimeIndex t) const noexcept {
    return actions.data() + static_cast<std::size_t>(t) * types.action.size();
  }
  [[nodiscard]] const std::byte* observation(TimeIndex t) const noexcept {
    return observations.data() + static_cast<std::size_t>(t) * types.observation.size();
  }
};

// Reads the steps [first, last) of `session`. `what` is the desired or the applied actions. Applied
// actions of joints become torques alone, because torques are what the motors got. Throws NotInLog,
// InvalidArgument.
[[nodiscard]] Motion read_motion(const log::LoggedSession& session, Series what,
                                 std::optional<TimeIndex> first, std::optional<TimeIndex> last);

struct ActionReplayOptions {
  std::optional<Nanoseconds> blend{};  // Move to the start pose, in this time or longer.
  double max_velocity{0.5};            // Largest velocity of the blend [rad/s].
  double tolerance{0.05};              // Tolerance of the start pose [rad].
  bool force{false};                   // For robots without joints: begin wherever it is.
};

// The robot is not where the motion begins. The text contains a table.
class WrongStartPose : public Error {
 public:
  using Error::Error;
};

// Repeats `motion` with the robot that `robot` controls, and finishes the session. `tell` gets
// messages about the progress, one sentence each.
//
// A robot with joints has a field `position` with equally many float64 in actions and in
// observations. It must be in the pose in which the motion began, or `blend` must be given. Then
// position actions with the robot's own gains first bring it there, on a smooth curve, to rest. If
// the first targets of the motion differ from that pose, they are approached smoothly, too. The
// robot never jumps.
//
// Throws IncompatibleSession if the robot is another one, InvalidArgument if its steps have another
// length, WrongStartPose, RobotStopped.
void replay_actions(Motion motion, Nanoseconds period, UntypedFrontend& robot,
                    const ActionReplayOptions& options,
                    const std::function<void(const std::string&)>& tell);

}  // namespace trifinger::apps
