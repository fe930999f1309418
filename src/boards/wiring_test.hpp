// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "boards/assignment.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// What a joint did when its motor was driven.
struct WiringFinding {
  bool moves{false};        ///< Something has moved.
  std::size_t joint{0};     ///< The joint that has moved; the joint itself if all is well.
  bool is_reversed{false};  ///< It has moved against the torque.
  bool is_hindered{false};  ///< It never moved twice in the same way; then the rest is a guess.

  /// True if this is right for the joint `own`.
  [[nodiscard]] bool is_good(std::size_t own) const noexcept {
    return moves && joint == own && !is_reversed && !is_hindered;
  }
};

/// Finds motors and encoders of different joints that are connected as if they were one, and motors
/// that turn the other way.
///
/// One joint after the other gets a short torque, forth, back and forth again, that moves it by
/// about 2 degrees and leaves it at rest; then the opposite. The displacements of all joints are a
/// column of a matrix. If motors and encoders belong together, this matrix is the inverse of the
/// joints' mass matrix, but for the lengths of its columns. Such a matrix is positive definite: its
/// diagonal is positive, and no order of the columns has a diagonal with a larger product. Weights
/// and earlier movements do not matter, because a constant, a velocity and an acceleration are
/// taken out of the measured angles. Friction makes the displacements smaller, which does not
/// matter either.
///
/// If the two pushes disagree, the joint has met something, such as an end stop. It is pushed again
/// with a torque beside it that carries it away. In the end, and if it does not move, a torque
/// grows slowly, forth and back, until something has moved by 2 degrees. The displacements then are
/// those of the joints' compliance, a matrix of the same kind.
///
/// Joints that were not good are tested up to three times, since a finger may have fallen on
/// another one meanwhile.
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
  /// The finding of each joint. During the test it is preliminary: joints that are good so far
  /// should be held where they are, which calms the others.
  [[nodiscard]] std::span<const WiringFinding> findings() const noexcept { return findings_; }

 private:
  enum class Half : std::uint8_t { kFirst, kOpposite };

  void begin_joint() noexcept;
  void begin_half(Half half) noexcept;
  [[nodiscard]] double next_of_push(std::span<const double> angles, double sign) noexcept;
  [[nodiscard]] double next_of_ramp(std::span<const double> angles) noexcept;
  void end_half() noexcept;
  void next_joint() noexcept;
  // The first joint from `begin` on that is not good; if there is none, the number of joints.
  [[nodiscard]] std::size_t first_bad(std::size_t begin) const noexcept;
  void judge() noexcept;
  [[nodiscard]] double& response(std::size_t moved, std::size_t driven) noexcept {
    return responses_[moved * max_torques_.size() + driven];
  }

  std::vector<double> max_torques_;
  std::size_t quarter_;          // steps of a quarter of the push
  std::vector<double> weights_;  // of the angle in each step of a push, for its displacement
  std::size_t ramp_{0};          // steps of a ramp
  std::size_t ramp_pause_{0};    // steps after it
  int round_{0};
  std::size_t joint_{0};
  std::size_t step_{0};
  double torque_{0.0};  // of the pushes of this joint
  std::size_t attempt_{0};
  Half half_{Half::kFirst};
  std::vector<double> displacements_;  // of each joint [rad]
  std::vector<double> start_;          // where each joint was before a ramp [rad]
  std::vector<double> first_;          // displacements of the first half
  std::vector<double> responses_;      // of all pushes [rad]
  std::vector<WiringFinding> findings_;
  Assignment assignment_;
};

}  // namespace trifinger::boards
