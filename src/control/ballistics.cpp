// SPDX-License-Identifier: BSD-3-Clause
#include "control/ballistics.hpp"

#include <cmath>

#include "trifinger/base/error.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::control {

BallisticEstimator::BallisticEstimator(double tolerance) : tolerance_(tolerance) {
  if (!(tolerance > 0.0)) throw InvalidArgument("the tolerance of a flight is not above zero");
}

void BallisticEstimator::add(Seconds time, const Eigen::Vector3d& position) noexcept {
  if (!std::isfinite(time.count()) || !position.allFinite()) return;
  if (count_ > 0 && time <= newest()) return;
  if (count_ == samples_.size()) {
    begin_ = (begin_ + 1) % samples_.size();
    --count_;
  }
  samples_[(begin_ + count_++) % samples_.size()] = {time, position};
  // Two positions always fit.
  while (fit() > tolerance_ && count_ > 2) {
    begin_ = (begin_ + 1) % samples_.size();
    --count_;
  }
}

Seconds BallisticEstimator::span() const noexcept {
  return count_ == 0 ? Seconds(0) : newest() - sample(0).time;
}

// Fits the flight, and returns the root mean square of the distances from it [m].
double BallisticEstimator::fit() noexcept {
  const auto number = static_cast<double>(count_);
  middle_ = Seconds(0);
  for (std::size_t i = 0; i < count_; ++i) middle_ += (sample(i).time - sample(0).time) / number;
  middle_ += sample(0).time;
  // Without gravity's part, positions lie on a straight line over time.
  const auto straight = [this](std::size_t i) -> Eigen::Vector3d {
    const double t = (sample(i).time - middle_).count();
    return sample(i).position - 0.5 * t * t * gravity();
  };
  double squares = 0.0;
  position_.setZero();
  velocity_.setZero();
  for (std::size_t i = 0; i < count_; ++i) {
    const double t = (sample(i).time - middle_).count();
    squares += t * t;
    position_ += straight(i) / number;
    velocity_ += t * straight(i);
  }
  if (squares > 0.0) velocity_ /= squares;
  double errors = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double t = (sample(i).time - middle_).count();
    errors += (straight(i) - position_ - t * velocity_).squaredNorm();
  }
  return std::sqrt(errors / number);
}

PointMotion BallisticEstimator::at(Seconds time) const noexcept {
  const double t = (time - middle_).count();
  return {.position = position_ + t * velocity_ + 0.5 * t * t * gravity(),
          .velocity = velocity_ + t * gravity(),
          .acceleration = gravity()};
}

std::optional<Seconds> BallisticEstimator::falls_through(double height) const noexcept {
  const double g = -gravity().z();
  const double square = velocity_.z() * velocity_.z() + 2.0 * g * (position_.z() - height);
  if (!(square >= 0.0)) return std::nullopt;
  return middle_ + Seconds((velocity_.z() + std::sqrt(square)) / g);
}

}  // namespace trifinger::control
