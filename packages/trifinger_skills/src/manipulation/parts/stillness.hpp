// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// Notices that tips have closed on something: their distance changes no more. Velocities would not
// tell: those of encoders are noisier than tips that close are fast.
class Stillness {
 public:
  // Still is what changes by less than `change` [m] during `time`.
  Stillness(double change, control::Seconds time) : change_(change), time_(time) {}

  // Forgets how long it was still.
  void restart() noexcept { since_ = control::Seconds(0); }
  // `counts` is false while it does not matter whether it is still.
  void follow(double distance, control::Seconds elapsed, bool counts) noexcept {
    since_ += elapsed;
    if (counts && std::abs(distance - from_) <= change_) return;
    from_ = distance;
    since_ = control::Seconds(0);
  }
  [[nodiscard]] bool is_still() const noexcept { return since_ >= time_; }

 private:
  double change_;
  control::Seconds time_;
  double from_{0.0};
  control::Seconds since_{0};
};

}  // namespace trifinger::manipulation
