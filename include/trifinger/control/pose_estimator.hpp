// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/control/motion.hpp"

namespace trifinger::control {

/// Estimates the current pose and motion of an object from poses that are few, noisy and old.
///
/// The estimator needs a known motion, such as the one on which the object is led. It estimates how
/// far the object deviates from that motion, and how the deviation changes. The deviation changes
/// much more slowly than the object's pose. It can therefore be filtered strongly and predicted
/// across the delay. The filter is critically damped and follows a deviation of constant rate
/// without lag. If there is no known motion, leave it out: the known pose then rests at the origin.
///
/// Times [s] may begin anywhere, but must have the same beginning in all calls.
class PoseEstimator {
 public:
  /// `bandwidth` tells how fast the estimate follows [Hz].
  /// @throws InvalidArgument if it is not above zero.
  explicit PoseEstimator(double bandwidth = 3.0);

  /// Takes `pose`, measured at `time`, when the known motion was at `known`. Ignores a pose that is
  /// not newer than the previous one or not finite, and then returns false.
  bool update(Seconds time, const Pose& pose, const Motion& known = {}) noexcept;

  /// The pose and motion of the object at `time`, when the known motion is at `known`. Before the
  /// first pose the result is `known`.
  [[nodiscard]] Motion predict(Seconds time, const Motion& known = {}) const noexcept;

  /// Time of the newest pose; negative infinity before the first.
  [[nodiscard]] Seconds last_time() const noexcept { return time_; }

  /// Forgets all poses.
  void reset() noexcept;

 private:
  double angular_frequency_;
  Seconds time_;
  Pose deviation_;  // Deviation of the object from the known motion at `time_`.
  Twist rate_;
};

}  // namespace trifinger::control
