// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "trifinger/base/time.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// Counts steps, and the time since a phase began. Steps may be left out by a late robot.
class PhaseClock {
 public:
  explicit PhaseClock(control::Seconds period) noexcept : period_(period) {}

  // Call this first in each update. Returns the time since the previous one, at least a period.
  control::Seconds advance(TimeIndex step) noexcept {
    const TimeIndex elapsed = std::max<TimeIndex>(step - step_, 1);
    step_ = step;
    return period_ * static_cast<double>(elapsed);
  }
  // A phase begins with this step.
  void begin_phase() noexcept { phase_begin_ = step_; }

  [[nodiscard]] TimeIndex step() const noexcept { return step_; }
  [[nodiscard]] control::Seconds now() const noexcept { return time_of(step_); }
  [[nodiscard]] control::Seconds in_phase() const noexcept {
    return period_ * static_cast<double>(step_ - phase_begin_);
  }
  [[nodiscard]] control::Seconds time_of(TimeIndex step) const noexcept {
    return period_ * static_cast<double>(step);
  }
  [[nodiscard]] control::Seconds period() const noexcept { return period_; }

 private:
  control::Seconds period_;
  TimeIndex step_{-1};
  TimeIndex phase_begin_{-1};
};

}  // namespace trifinger::manipulation
