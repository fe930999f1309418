// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/orderly_stop.hpp"

#include <algorithm>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

std::string in_seconds(Nanoseconds time) {
  return std::to_string(std::chrono::duration<double>(time).count());
}

TimeIndex steps_in(Nanoseconds time, Nanoseconds period) noexcept {
  return (time + period - Nanoseconds(1)) / period;
}

}  // namespace

Nanoseconds OrderlyStopOptions::shortest_move_time(
    std::span<const JointLimit> limits) const noexcept {
  // A movement of least jerk is faster in its middle than on average, by this factor.
  constexpr double kPeak = 1.875;
  // Part of the torque that the safety damping may use. The rest carries and accelerates.
  constexpr double kDamping = 0.5;
  double shortest = 0.0;
  for (std::size_t i = 0; rest_position && i < rest_position->size(); ++i) {
    const bool has_ends =
        limits[i].soft_lower > -kLargestJointLimit && limits[i].soft_upper < kLargestJointLimit;
    if (!has_ends) continue;
    const double rest = (*rest_position)[i];
    const double distance = std::max(limits[i].soft_upper - rest, rest - limits[i].soft_lower);
    shortest = std::max(shortest,
                        kPeak * distance * limits[i].safety_kd / (kDamping * limits[i].max_torque));
  }
  return std::chrono::ceil<Nanoseconds>(std::chrono::duration<double>(shortest));
}

void OrderlyStopOptions::validate(std::span<const JointLimit> limits) const {
  if (damping_time < Nanoseconds::zero()) throw InvalidArgument("damping_time is negative");
  if (!rest_position) return;
  if (rest_position->size() != limits.size()) {
    throw InvalidArgument("rest_position has " + std::to_string(rest_position->size()) +
                          " numbers, must have one for each of " + std::to_string(limits.size()) +
                          " joints");
  }
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const double rest = (*rest_position)[i];
    // The comparison is written so that NaN fails.
    if (rest >= limits[i].soft_lower && rest <= limits[i].soft_upper) continue;
    throw InvalidArgument("rest_position of joint " + std::to_string(i) + " is " +
                          std::to_string(rest) + ", must be within its soft limits, " +
                          std::to_string(limits[i].soft_lower) + " to " +
                          std::to_string(limits[i].soft_upper));
  }
  if (const Nanoseconds shortest = shortest_move_time(limits);
      move_time < shortest || move_time <= Nanoseconds::zero()) {
    throw InvalidArgument("move_time is " + in_seconds(move_time) + " s, must be at least " +
                          in_seconds(shortest) + " s, or the joints cannot follow");
  }
}

OrderlyStop::OrderlyStop(const OrderlyStopOptions& options, Nanoseconds period)
    : damping_steps_(steps_in(options.damping_time, period)),
      move_steps_(options.rest_position ? steps_in(options.move_time, period) : 0),
      rest_(options.rest_position.value_or(std::vector<double>{})),
      start_(rest_.size()) {}

OrderlyStop::Phase OrderlyStop::next(TimeIndex step, std::span<const double> position,
                                     std::span<double> target) noexcept {
  if (step == 0) {
    end_ = num_steps();
    is_given_up_ = false;
  }
  if (step >= end_) return Phase::kOver;
  if (step < damping_steps_ || is_given_up_) return Phase::kDamp;
  if (step == damping_steps_) std::copy_n(position.begin(), start_.size(), start_.begin());
  const double done = detail::smooth(static_cast<double>(step - damping_steps_ + 1) /
                                     static_cast<double>(move_steps_));
  for (std::size_t i = 0; i < rest_.size(); ++i) {
    target[i] = start_[i] + done * (rest_[i] - start_[i]);
  }
  return Phase::kMove;
}

void OrderlyStop::give_up(TimeIndex step) noexcept {
  if (is_given_up_) return;
  is_given_up_ = true;
  end_ = step < damping_steps_ ? damping_steps_ : step + 1 + damping_steps_;
}

}  // namespace trifinger
