// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/balance/tilt_observer.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace trifinger::manipulation {
namespace {

constexpr double kFirstTilt = 0.2;      // Standard deviations before the first pose [rad], ...
constexpr double kFirstRate = 0.5;      // ... [rad/s], ...
constexpr double kFirstOffset = 0.005;  // ... [m], ...
constexpr double kFirstError = 0.003;   // ... of the place of the tip [m].

double squared(double value) noexcept { return value * value; }

}  // namespace

TiltObserver::TiltObserver(const TippingBox& box, const TiltObserverConfig& config,
                           control::Seconds period)
    : box_(box), config_(config), period_(period.count()) {
  Eigen::Matrix4d change = Eigen::Matrix4d::Zero();  // In a period, to the first order.
  change(0, 1) = period_;
  change(1, 0) = period_ * box_.fall();
  change(1, 2) = -period_ * TippingBox::kGravity / box_.inertia();
  transition_ = Eigen::Matrix4d::Identity() + change + change * change / 2;
  reset(0);
}

void TiltObserver::reset(TimeIndex step) noexcept {
  first_ = step;
  newest_ = step - 1;
  pose_step_ = step;
  has_seen_ = false;
  at_pose_.setZero();
  now_.setZero();
  covariance_ = Eigen::Vector4d(squared(kFirstTilt), squared(kFirstRate), squared(kFirstOffset),
                                squared(kFirstError))
                    .asDiagonal();
}

TiltObserver::State TiltObserver::after(const State& state, const TipInput& input) const noexcept {
  State next = transition_ * state;
  next.row(0) -= period_ * box_.lever() * input.rate.transpose();
  next.row(1) += period_ * TippingBox::kGravity / box_.inertia() * input.roll.transpose();
  return next;
}

void TiltObserver::move(TimeIndex step, const TipInput& input) noexcept {
  if (step <= newest_) return;
  // After a gap longer than the memory, nothing is known of the time between.
  const TimeIndex from = std::max(newest_ + 1, step - kMemory + 1);
  for (TimeIndex i = from; i <= step; ++i) {
    if (i > first_) now_ = after(now_, input);
    inputs_[static_cast<std::size_t>((i + kMemory) % kMemory)] = input;
  }
  newest_ = step;
  first_ = std::max(first_, step - kMemory + 1);
}

bool TiltObserver::see(TimeIndex captured, const Eigen::Vector2d& tilt,
                       const Eigen::Vector2d& centre) noexcept {
  if (captured < first_ || captured > newest_ || (has_seen_ && captured <= pose_step_) ||
      !tilt.allFinite() || !centre.allFinite())
    return false;
  // Up to the step of the pose.
  for (TimeIndex i = std::max(pose_step_, first_); i < captured; ++i) {
    at_pose_ = after(at_pose_, input_at(i + 1));
    covariance_ = transition_ * covariance_ * transition_.transpose();
    covariance_(1, 1) += squared(config_.disturbance) * period_;
    covariance_(2, 2) += squared(config_.drift) * period_;
    covariance_(3, 3) += squared(config_.drift) * period_;
  }
  Eigen::Matrix<double, 2, 4> seen;
  seen << 1.0, 0.0, 0.0, 0.0, box_.half_height, 0.0, -1.0, -1.0;
  const Eigen::Matrix2d noise =
      Eigen::Vector2d(squared(config_.tilt_noise), squared(config_.position_noise)).asDiagonal();
  const Eigen::Matrix2d innovation = seen * covariance_ * seen.transpose() + noise;
  const Eigen::Matrix<double, 4, 2> gain = covariance_ * seen.transpose() * innovation.inverse();
  Eigen::Matrix2d measured;
  measured.row(0) = tilt.transpose();
  measured.row(1) = (centre - input_at(captured).place).transpose();
  at_pose_ += gain * (measured - seen * at_pose_);
  // Joseph's form keeps it symmetric and positive.
  const Eigen::Matrix4d rest = Eigen::Matrix4d::Identity() - gain * seen;
  covariance_ = rest * covariance_ * rest.transpose() + gain * noise * gain.transpose();
  pose_step_ = captured;
  has_seen_ = true;

  now_ = at_pose_;
  for (TimeIndex i = captured + 1; i <= newest_; ++i) now_ = after(now_, input_at(i));
  return true;
}

TiltEstimate TiltObserver::estimate() const noexcept {
  if (newest_ < first_) return {};
  const TipInput& input = input_at(newest_);
  return {.tilt = now_.row(0).transpose(),
          .rate = now_.row(1).transpose() - box_.lever() * input.rate,
          .balance = (now_.row(2).transpose() - input.roll) / (box_.half_height - box_.tip_radius)};
}

}  // namespace trifinger::manipulation
