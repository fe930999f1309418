// SPDX-License-Identifier: BSD-3-Clause
#include "boards/homing.hpp"

#include <algorithm>
#include <cmath>

namespace trifinger::boards {
namespace {

// A joint stands still if it has moved less than this in a tenth of a second: 0.01 rad/s.
constexpr double kStillDistance = 0.001;
constexpr double kStillTime = 0.1;
// Before this time a joint may just not have begun to move.
constexpr double kShortestPush = 1.0;
// For so long a joint that was let go relaxes [s].
constexpr double kReleaseTime = 1.0;
// Speed of the search for an index [rad/s].
constexpr double kSearchSpeed = 0.3;
// Longest travel of that search, in revolutions of the motor.
constexpr double kLargestSearch = 1.5;

}  // namespace

void JointHoming::begin(HomingMethod method, double torque, double index_distance,
                        const HomingMeasurement& measured) noexcept {
  method_ = method;
  torque_ = torque;
  index_distance_ = index_distance;
  is_home_ = false;
  switch (method) {
    case HomingMethod::kEndStopIndex:
    case HomingMethod::kEndStop:
    case HomingMethod::kReleasedEndStop:
      begin_part(Part::kPush, measured);
      break;
    case HomingMethod::kNextIndex:
      begin_part(Part::kIndex, measured);
      break;
    case HomingMethod::kHere:
      begin_part(Part::kDone, measured);
      break;
  }
}

void JointHoming::begin_part(Part part, const HomingMeasurement& measured) noexcept {
  part_ = part;
  is_part_done_ = part == Part::kDone;
  time_ = 0.0;
  start_ = measured.angle;
  still_angle_ = measured.angle;
  still_time_ = 0.0;
  target_ = measured.angle;
  pulses_ = measured.index_pulses;
  if (part == Part::kDone && method_ != HomingMethod::kEndStopIndex &&
      method_ != HomingMethod::kNextIndex) {
    home_ = measured.angle;
  }
}

bool JointHoming::next_part(const HomingMeasurement& measured) noexcept {
  // Other joints still search. It may have moved since.
  if (is_home_) return false;
  const bool has_pushed = part_ == Part::kPush;
  if (has_pushed && method_ == HomingMethod::kEndStopIndex) {
    begin_part(Part::kIndex, measured);
  } else if (has_pushed && method_ == HomingMethod::kReleasedEndStop) {
    begin_part(Part::kRelease, measured);
  } else {
    begin_part(Part::kDone, measured);
    is_home_ = true;
  }
  return part_ != Part::kDone;
}

double JointHoming::next(const HomingMeasurement& measured, const HomingGains& gains,
                         double period) noexcept {
  time_ += period;
  double torque = 0.0;
  if (part_ == Part::kPush) torque = push(measured, gains, period);
  if (part_ == Part::kIndex) torque = search_index(measured, gains, period);
  // Its home is here, whatever happens until the others have found theirs.
  if (part_ == Part::kDone) static_cast<void>(next_part(measured));
  if (part_ == Part::kRelease) is_part_done_ = time_ >= kReleaseTime;
  return std::clamp(torque - gains.kd * measured.velocity, -gains.max_torque, gains.max_torque);
}

// With damping, the torque decides about the speed.
double JointHoming::push(const HomingMeasurement& measured, const HomingGains& gains,
                         double period) noexcept {
  still_time_ += period;
  if (std::abs(measured.angle - still_angle_) > kStillDistance) {
    still_angle_ = measured.angle;
    still_time_ = 0.0;
  }
  is_part_done_ = time_ >= kShortestPush && still_time_ >= kStillTime;
  return std::clamp(torque_, -gains.max_torque, gains.max_torque);
}

double JointHoming::search_index(const HomingMeasurement& measured, const HomingGains& gains,
                                 double period) noexcept {
  if (!is_part_done_ && measured.index_pulses != pulses_) {
    is_part_done_ = true;
    home_ = measured.index;
    // The joint waits there for the others.
    target_ = measured.angle;
  }
  // From an end stop it turns back, otherwise in the direction of the torque.
  const double away = method_ == HomingMethod::kEndStopIndex ? -1.0 : 1.0;
  if (!is_part_done_) target_ += std::copysign(kSearchSpeed * period, away * torque_);
  return gains.kp * (target_ - measured.angle);
}

JointHoming::Failure JointHoming::failure(const HomingMeasurement& measured,
                                          double max_travel) const noexcept {
  const double travel = std::abs(measured.angle - start_);
  if (part_ == Part::kIndex && !is_part_done_ &&
      std::abs(target_ - start_) > kLargestSearch * index_distance_) {
    return Failure::kNoIndex;
  }
  return part_ != Part::kDone && travel > max_travel ? Failure::kTooFar : Failure::kNone;
}

}  // namespace trifinger::boards
