// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/boards/assignment.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// What a joint did when its motor was driven.
struct WiringFinding {
  bool moves{false};        ///< Something has moved.
  std::size_t joint{0};     ///< The joint that has moved; the joint itself if all is well.
  bool is_reversed{false};  ///< It has moved against the torque.
};

/// Finds motors and encoders of different joints that are connected as if they were one, and motors
/// that turn the other way.
///
/// One joint after the other gets a short torque, forth, back and forth again, that moves it by
/// about 2 degrees and leaves it at rest. The accelerations of all joints per torque are a column
/// of a matrix. If motors and encoders belong together, this matrix is the inverse of the joints'
/// mass matrix, so it is positive definite: its diagonal is positive, and no order of the columns
/// has a diagonal with a larger product. Weights and earlier movements do not matter, because a
/// constant, a velocity and an acceleration are taken out of the measured angles. Friction makes
/// the accelerations smaller, which does not matter either.
///
/// It cannot find a motor and its encoder that together are in the place of another joint's.
class WiringTest {
 public:
  /// `max_torques` has the largest torque of each joint [Nm]. `period` is the time between two
  /// calls of `next`.
  WiringTest(std::span<const double> max_torques, Nanoseconds period);

  void begin() noexcept TRIFINGER_REALTIME;

  /// Writes the torques of the next step [Nm]. `angles` are those of all joints [rad].
  void next(std::span<const double> angles, std::span<double> torques) noexcept TRIFINGER_REALTIME;

  [[nodiscard]] bool is_done() const noexcept { return joint_ == max_torques_.size(); }
  /// The joint that is driven now.
  [[nodiscard]] std::size_t joint() const noexcept { return joint_; }
  /// The finding of each joint, after the test.
  [[nodiscard]] std::span<const WiringFinding> findings() const noexcept { return findings_; }

 private:
  void begin_push(double torque) noexcept;
  void end_push() noexcept;
  void judge() noexcept;
  [[nodiscard]] double& response(std::size_t moved, std::size_t driven) noexcept {
    return responses_[moved * max_torques_.size() + driven];
  }

  std::vector<double> max_torques_;
  std::size_t quarter_;          // steps of a quarter of the push
  std::vector<double> weights_;  // of the angle in each step of a push, for its acceleration
  double way_;                   // largest way of a push, for an acceleration of 1 rad/s^2
  std::size_t joint_{0};
  std::size_t step_{0};
  double torque_{0.0};
  std::vector<double> accelerations_;  // of each joint in this push [rad/s^2]
  std::vector<double> responses_;      // of all pushes [rad/s^2/Nm]
  std::vector<WiringFinding> findings_;
  Assignment assignment_;
};

}  // namespace trifinger::boards
