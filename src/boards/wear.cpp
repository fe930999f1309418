// SPDX-License-Identifier: BSD-3-Clause
#include "boards/wear.hpp"

#include <cmath>
#include <numbers>

namespace trifinger::boards {
namespace {

// Half of the movement to and fro that does not count [revolutions]: 20 steps of the encoder.
constexpr double kPlay = 0.001;
// The boards' own limit: one degree.
constexpr double kLargestIndexError = 1.0 / 360.0;

bool is_whole(double revolutions) noexcept {
  return std::abs(revolutions - std::round(revolutions)) <= kLargestIndexError;
}

}  // namespace

MotorMeter::Step MotorMeter::measure(const MotorReading& motor, double elapsed,
                                     double torque_constant, double most_revolutions) noexcept {
  Step step{.powered_time = elapsed, .squared_current = motor.amperes * motor.amperes * elapsed};
  if (place_ && std::abs(motor.revolutions - *place_) > most_revolutions) forget(motor);
  if (!place_) place_ = motor.revolutions;
  const double distance = motor.revolutions - *place_;
  if (std::abs(distance) > kPlay) {
    const double travel = distance - std::copysign(kPlay, distance);
    *place_ += travel;
    step.revolutions = std::abs(travel);
    step.work = std::abs(torque_constant * motor.amperes * 2.0 * std::numbers::pi * travel);
  }
  if (motor.index_pulses != pulses_) {
    step.has_slipped = index_ && !is_whole(*motor.index - *index_);
    index_ = motor.index;
    pulses_ = motor.index_pulses;
  }
  return step;
}

}  // namespace trifinger::boards
