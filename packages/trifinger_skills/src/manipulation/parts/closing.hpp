// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "trifinger/control/impedance.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// Tips close on something, and it is noticed when they have: their distance hardly changes any
// more.
//
// The distance follows a way on which springs pull the tips along. A constant force would need much
// damping, with which motors that have play rattle, and would not overcome the friction of joints.
// Velocities would not tell that tips are still: those of encoders are noisier than tips are fast.
class Closing {
 public:
  // The distance gets less with `speed` [m/s]; a tip presses with at most `force` [N].
  Closing(double speed, double force, const control::TipGains& gains)
      : speed_(speed), force_(force), gains_(gains) {}

  void begin(double distance) noexcept {
    way_ = from_ = distance;
    since_ = control::Seconds(0);
  }

  // `fits`: what the tips close on may be between them if this is their distance [m].
  void follow(double distance, bool fits, control::Seconds elapsed) noexcept {
    // What the tips have met holds them back, and the way with them.
    const double shortest = distance - 2 * force_ / gains_.stiffness;
    way_ = std::max(way_ - speed_ * elapsed.count(), shortest);
    pull_ = gains_.stiffness * (distance - way_) / 2;
    if (way_ > shortest) pull_ += gains_.damping * speed_ / 2;

    since_ += elapsed;
    // Motors that rattle in their play change it a little, even if the tips stay where they are.
    if (fits && std::abs(distance - from_) <= speed_ * kSettle.count() / 4) return;
    from_ = distance;
    since_ = control::Seconds(0);
  }

  // The speed at which each tip should move to the other [m/s].
  [[nodiscard]] double speed() const noexcept { return has_closed() ? 0.0 : speed_ / 2; }
  // The force that pulls each tip to the other [N], without what damps the speed that they have.
  [[nodiscard]] double pull() const noexcept { return pull_; }
  [[nodiscard]] bool has_closed() const noexcept { return since_ >= kSettle; }

 private:
  static constexpr control::Seconds kSettle{0.1};

  double speed_;
  double force_;
  control::TipGains gains_;
  double way_{0.0};   // The distance that the tips should have [m].
  double pull_{0.0};  // [N]
  double from_{0.0};  // The distance since when they are still [m].
  control::Seconds since_{0};
};

}  // namespace trifinger::manipulation
