// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/realtime/annotations.hpp"

namespace trifinger::boards {

/// What a slow movement there and back has measured.
struct SweepResult {
  double load{0.0};      ///< Torque that carries the weight of the joint [Nm].
  double friction{0.0};  ///< Torque against which it moves [Nm].
  double error{0.0};     ///< How far it was from its target where it turned [rad].
};

/// Moves a joint by 2 degrees and back, slowly. Friction acts against the movement and weight does
/// not, so the torques of both passes tell them apart: the load is their mean, friction is half of
/// their difference.
class JointSweep {
 public:
  void begin() noexcept TRIFINGER_REALTIME;

  /// Returns the next target, from where the joint began [rad]. `period` is the time between two
  /// steps [s].
  [[nodiscard]] double next(double period) noexcept TRIFINGER_REALTIME;
  /// `torque` moves the joint now [Nm], `offset` is where it is, from where it began [rad].
  void add(double torque, double offset) noexcept TRIFINGER_REALTIME;

  [[nodiscard]] bool is_done() const noexcept;
  [[nodiscard]] SweepResult result() const noexcept;

 private:
  struct Mean {
    double sum{0.0};
    int count{0};
    [[nodiscard]] double value() const noexcept { return count > 0 ? sum / count : 0.0; }
  };

  double time_{0.0};  // [s]
  double target_{0.0};
  Mean there_{};
  Mean back_{};
  double error_{0.0};
};

}  // namespace trifinger::boards
