// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>

#include "trifinger/control/motion.hpp"

/// \file
/// Trajectories from rest to rest. Each is a function of the time since its beginning. Before that
/// time it rests at its start, and after its duration at its end. Position, velocity and
/// acceleration are continuous.

namespace trifinger::control {

/// Progress of a movement, with its derivatives.
struct Progress {
  double value;         ///< 0 at the beginning, 1 at the end.
  double rate;          ///< [1/s]
  double acceleration;  ///< [1/s^2]
};

/// The movement of least jerk from rest to rest: `10 s^3 - 15 s^4 + 6 s^5`, where s is the share of
/// `duration` that has passed. It is complete if `duration` is not positive.
[[nodiscard]] Progress minimum_jerk(Seconds time, Seconds duration) noexcept;

/// A straight line with the least jerk.
class LineTrajectory {
 public:
  /// @throws InvalidArgument if a number is not finite or `duration` is not above zero.
  LineTrajectory(const Eigen::Vector3d& start, const Eigen::Vector3d& end, Seconds duration);

  /// Time from the start to the end [s].
  [[nodiscard]] Seconds duration() const noexcept { return duration_; }
  /// The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
  /// `duration` at its end.
  [[nodiscard]] PointMotion at(Seconds time) const noexcept;

 private:
  Eigen::Vector3d start_;
  Eigen::Vector3d displacement_;
  Seconds duration_;
};

/// A straight line, and a rotation about a fixed axis through the smaller angle, with least jerk.
class PoseTrajectory {
 public:
  /// @throws InvalidArgument if a number is not finite, a quaternion does not have unit length, or
  /// `duration` is not above zero.
  PoseTrajectory(const Pose& start, const Pose& end, Seconds duration);

  /// Time from the start to the end [s].
  [[nodiscard]] Seconds duration() const noexcept { return duration_; }
  /// The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
  /// `duration` at its end.
  [[nodiscard]] Motion at(Seconds time) const noexcept;

 private:
  Pose start_;
  Eigen::Vector3d displacement_;
  Eigen::Vector3d turn_;
  Seconds duration_;
};

/// Trajectories from pose to pose, one after the other. The body rests between them.
class PoseSequence {
 public:
  static constexpr std::size_t kMaxTrajectories = 4;

  /// A sequence of one trajectory.
  explicit PoseSequence(const PoseTrajectory& trajectory);

  /// Adds a trajectory after the last one. It should begin where that one ends.
  /// @throws InvalidArgument if there are `kMaxTrajectories` already
  void add(const PoseTrajectory& trajectory);

  /// Time from the start of the first trajectory to the end of the last [s].
  [[nodiscard]] Seconds duration() const noexcept;
  /// The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
  /// `duration` at its end.
  [[nodiscard]] Motion at(Seconds time) const noexcept;

 private:
  std::array<std::optional<PoseTrajectory>, kMaxTrajectories> trajectories_;
  std::size_t count_{0};
};

/// A circle and the speed on it.
struct CircleConfig {
  Eigen::Vector3d centre{Eigen::Vector3d::Zero()};  ///< [m]
  double radius{0.05};                              ///< [m]
  double start_angle{0.0};                          ///< Angle from x towards y [rad].
  double turns{3.0};       ///< Any number but zero; negative means clockwise.
  Seconds period{4.0};     ///< Time of one turn at full speed [s].
  Seconds ramp_time{1.0};  ///< Time from rest to full speed, and from full speed to rest [s].
};

/// A horizontal circle that gains its speed smoothly and loses it at the end.
class CircleTrajectory {
 public:
  /// @throws InvalidArgument that names the first value that makes no sense, for example turns that
  /// are too few for the ramps.
  explicit CircleTrajectory(const CircleConfig& config);

  /// `|turns| * period + ramp_time` [s].
  [[nodiscard]] Seconds duration() const noexcept;
  /// The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
  /// `duration` at its end.
  [[nodiscard]] PointMotion at(Seconds time) const noexcept;

 private:
  CircleConfig config_;
};

}  // namespace trifinger::control
