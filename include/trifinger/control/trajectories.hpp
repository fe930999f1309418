// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "trifinger/control/motion.hpp"

/// \file
/// Ways from rest to rest. Each is a function of the time since its begin; before it rests at its
/// begin, after its duration at its end. Position, velocity and acceleration are continuous.

namespace trifinger::control {

/// How far a movement is, and how that changes.
struct Progress {
  double value;         ///< 0 at the begin, 1 at the end.
  double rate;          ///< [1/s]
  double acceleration;  ///< [1/s^2]
};

/// The movement of the least jerk from rest to rest: `10 s^3 - 15 s^4 + 6 s^5`, where s is the
/// share of `duration` that has passed. Complete if `duration` is not positive.
[[nodiscard]] Progress minimum_jerk(Seconds time, Seconds duration) noexcept;

/// A straight line with the least jerk.
class LineTrajectory {
 public:
  /// @throws InvalidArgument if a number is not finite or `duration` is not above zero.
  LineTrajectory(const Eigen::Vector3d& start, const Eigen::Vector3d& end, Seconds duration);

  [[nodiscard]] Seconds duration() const noexcept { return duration_; }
  [[nodiscard]] PointMotion at(Seconds time) const noexcept;

 private:
  Eigen::Vector3d start_;
  Eigen::Vector3d way_;
  Seconds duration_;
};

/// A straight line and a rotation about a fixed axis, the shorter way round, with the least jerk.
class PoseTrajectory {
 public:
  /// @throws InvalidArgument if a number is not finite, a quaternion not of unit length, or
  /// `duration` not above zero.
  PoseTrajectory(const Pose& start, const Pose& end, Seconds duration);

  [[nodiscard]] Seconds duration() const noexcept { return duration_; }
  [[nodiscard]] Motion at(Seconds time) const noexcept;

 private:
  Pose start_;
  Eigen::Vector3d way_;
  Eigen::Vector3d turn_;
  Seconds duration_;
};

struct CircleConfig {
  Eigen::Vector3d centre{Eigen::Vector3d::Zero()};  ///< [m]
  double radius{0.05};                              ///< [m]
  double start_angle{0.0};                          ///< From x towards y [rad].
  double turns{3.0};       ///< Any number but zero; below zero it goes clockwise.
  Seconds period{4.0};     ///< Of one turn at full speed.
  Seconds ramp_time{1.0};  ///< From rest to full speed, and at the end back to rest.
};

/// A horizontal circle that gains its speed smoothly and loses it at the end.
class CircleTrajectory {
 public:
  /// @throws InvalidArgument naming the first value that makes no sense, as turns that are too few
  /// for the ramps.
  explicit CircleTrajectory(const CircleConfig& config);

  /// `|turns| * period + ramp_time`.
  [[nodiscard]] Seconds duration() const noexcept;
  [[nodiscard]] PointMotion at(Seconds time) const noexcept;

 private:
  CircleConfig config_;
};

}  // namespace trifinger::control
