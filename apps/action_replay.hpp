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

// Recorded actions that a robot shall do again, and the pose in which that began.
struct Motion {
  RobotTypes types;
  std::vector<std::byte> actions;
  std::vector<std::byte> observations;  // one per action
  TimeIndex first{0};                   // in the log

  [[nodiscard]] TimeIndex steps() const noexcept {
    return static_cast<TimeIndex>(actions.size() / types.action.size());
  }
};

// Takes the steps [first, last) of `session`. `what` is the desired or the applied actions; those
// of joints become torques alone, which is what the motors were given. Throws NotInLog,
// InvalidArgument.
[[nodiscard]] Motion read_motion(const log::LoggedSession& session, Series what,
                                 std::optional<TimeIndex> first, std::optional<TimeIndex> last);

struct ActionReplayOptions {
  std::optional<Nanoseconds> blend{};  // Move to the start pose, in this time or longer.
  double max_velocity{0.5};            // Of the blend [rad/s].
  double tolerance{0.05};              // Of the start pose [rad].
  bool force{false};                   // For robots without joints: begin wherever it is.
};

// The robot is not where the motion begins. The text has a table.
class WrongStartPose : public Error {
 public:
  using Error::Error;
};

// Does `motion` with the robot that `robot` controls, and finishes the session. `tell` gets a
// sentence for people now and then.
//
// A robot with joints, that is with a field `position` of as many float64 in actions and in
// observations, must be in the pose in which the motion began, or is brought there if `blend` is
// given: with position actions and the robot's own gains, on a smooth curve, to rest. Targets that
// were elsewhere in the beginning are then led there likewise. It never jumps.
//
// Throws IncompatibleSession if it is another robot, InvalidArgument if its steps have another
// length, WrongStartPose, RobotStopped.
void replay_actions(Motion motion, Nanoseconds period, UntypedFrontend& robot,
                    const ActionReplayOptions& options,
                    const std::function<void(const std::string&)>& tell);

}  // namespace trifinger::apps
