// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/control/motion.hpp"

namespace trifinger::control {

/// Where an object is now and how it moves, from poses that are few, noisy and old.
///
/// It estimates how far the object is from a motion that is known, such as the one it is led on,
/// and how that deviation changes: much slower than the object itself, so that it can be filtered
/// well and predicted across the delay. The filter is critically damped and follows a deviation of
/// constant rate without lag. Without a known motion leave it out: a known pose that rests at the
/// origin.
///
/// Times are those since any begin, the same for all calls.
class PoseEstimator {
 public:
  /// `bandwidth` is how fast the estimate follows [Hz].
  /// @throws InvalidArgument if it is not above zero.
  explicit PoseEstimator(double bandwidth = 3.0);

  /// Takes `pose`, measured at `time`, when the known motion was at `known`. Ignores one that is
  /// not newer than the one before or not finite, and then answers false.
  bool update(Seconds time, const Pose& pose, const Motion& known = {}) noexcept;

  /// Where the object is at `time`, when the known motion is at `known`. Before the first pose that
  /// is `known` itself.
  [[nodiscard]] Motion predict(Seconds time, const Motion& known = {}) const noexcept;

  /// Time of the newest pose; negative infinity before the first.
  [[nodiscard]] Seconds last_time() const noexcept { return time_; }

  /// Forgets all poses.
  void reset() noexcept;

 private:
  double angular_frequency_;
  Seconds time_;
  Pose deviation_;  // Of the object from the known motion, at `time_`.
  Twist rate_;
};

}  // namespace trifinger::control
