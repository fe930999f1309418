// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "trifinger/manipulation/skill.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

/// A motion that was taught: where the joints were, and how hard they were led, at even intervals.
struct TaughtMotion {
  /// One instant of the motion.
  struct Instant {
    JointValues position;  ///< [rad]
    JointValues velocity;  ///< [rad/s]
    JointValues torque;    ///< Of whoever led the tips [Nm].
  };

  Seconds interval{0.01};              ///< From one sample to the next.
  std::vector<JointValues> positions;  ///< Nine joints per sample, at least two samples [rad].
  /// Torques with which the tips were led, as many as positions [Nm]: J' f for forces f at the
  /// tips. Without them a grip that was taught would have no force.
  std::vector<JointValues> torques;

  [[nodiscard]] Seconds duration() const noexcept {
    return interval * static_cast<double>(positions.size() - 1);
  }
  /// The motion at `time` since its beginning: positions on cubic Hermite splines whose slopes are
  /// central differences, torques on straight lines. It rests before its beginning and after its
  /// end.
  [[nodiscard]] Instant at(Seconds time) const noexcept;
};

/// Reads a motion: a line of names, then a row per sample with the time [s], nine positions and
/// nine torques, with commas in between.
/// @throws InvalidArgument that names the line that is wrong, SystemError
[[nodiscard]] TaughtMotion load_taught_motion(const std::filesystem::path& path);

/// The text of a file that `load_taught_motion` reads, to the last digit that counts.
[[nodiscard]] std::string text_of(const TaughtMotion& motion);

/// Plays a motion instead of what `skill` would do, and never looks: no pose changes it. The object
/// and the figures are those of `skill`.
///
/// The torques are those that led the tips, those that the motion needs in free space, and those of
/// the joints' springs towards their positions with the robot's own gains.
/// Desired positions stay within the soft limits.
/// @throws InvalidArgument if the robot has not nine joints, or if a position is more than 0.2 rad
/// beyond its soft limits
[[nodiscard]] std::unique_ptr<Skill> play_instead(std::unique_ptr<Skill> skill,
                                                  const SkillContext& context, TaughtMotion motion);

}  // namespace trifinger::manipulation
