// SPDX-License-Identifier: BSD-3-Clause
#include "boards/joint_sweep.hpp"

#include <cmath>
#include <numbers>

namespace trifinger::boards {
namespace {

constexpr double kSweep = 2.0 * std::numbers::pi / 180.0;  // [rad]
constexpr double kPassTime = 1.0;                          // in each direction [s]
constexpr double kRest = 0.3;                              // at the end, before the next joint [s]
// In this part of a pass the joint has not begun to follow.
constexpr double kBegin = 0.4;

}  // namespace

void JointSweep::begin() noexcept { *this = {}; }

double JointSweep::next(double period) noexcept {
  time_ += period;
  const double passes = time_ / kPassTime;
  target_ = kSweep * (passes < 1.0 ? passes : std::max(0.0, 2.0 - passes));
  return target_;
}

void JointSweep::add(double torque, double offset) noexcept {
  const double passes = time_ / kPassTime;
  if (passes >= 2.0) return;
  const bool is_back = passes >= 1.0;
  if (passes - (is_back ? 1.0 : 0.0) < kBegin) return;
  Mean& mean = is_back ? back_ : there_;
  mean.sum += torque;
  ++mean.count;
  if (!is_back) error_ = std::abs(target_ - offset);
}

bool JointSweep::is_done() const noexcept { return time_ >= 2.0 * kPassTime + kRest; }

SweepResult JointSweep::result() const noexcept {
  return {.load = 0.5 * (there_.value() + back_.value()),
          .friction = 0.5 * (there_.value() - back_.value()),
          .error = error_};
}

}  // namespace trifinger::boards
