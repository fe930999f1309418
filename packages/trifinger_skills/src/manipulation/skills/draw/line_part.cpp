// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/draw/line_part.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "trifinger/control/trajectories.hpp"

namespace trifinger::manipulation {
namespace {

using control::Seconds;
using Eigen::Vector2d;

// The integral of the progress of least jerk: how far a ramp has come, in shares of its time.
double ramp_distance(double s) noexcept { return s * s * s * s * (2.5 - 3 * s + s * s); }

}  // namespace

LinePart::LinePart(PenStroke points, double speed, Seconds ramp)
    : points_(std::move(points)), speed_(speed), ramp_(ramp) {
  lengths_.push_back(0.0);
  for (std::size_t i = 1; i < points_.size(); ++i)
    lengths_.push_back(lengths_.back() + (points_[i] - points_[i - 1]).norm());
  // A short part has no time for the whole speed.
  const double length = lengths_.back();
  speed_ = std::min(speed_, length / ramp_.count());
  duration_ = Seconds(length / speed_) + ramp_;
}

NibMotion LinePart::at(Seconds time) const noexcept {
  const double length = lengths_.back();
  const Seconds begin = std::clamp(time, Seconds(0), duration_);
  const Seconds end = duration_ - begin;
  double distance = 0.0;
  double rate = speed_;
  double acceleration = 0.0;
  if (begin < ramp_) {
    const control::Progress progress = control::minimum_jerk(begin, ramp_);
    distance = speed_ * ramp_.count() * ramp_distance(begin / ramp_);
    rate = speed_ * progress.value;
    acceleration = speed_ * progress.rate;
  } else if (end < ramp_) {
    const control::Progress progress = control::minimum_jerk(end, ramp_);
    distance = length - speed_ * ramp_.count() * ramp_distance(end / ramp_);
    rate = speed_ * progress.value;
    acceleration = -speed_ * progress.rate;
  } else {
    distance = speed_ * (begin - ramp_ / 2).count();
  }
  const auto after = std::ranges::upper_bound(lengths_, distance);
  const auto last = static_cast<std::ptrdiff_t>(points_.size()) - 1;
  const auto i =
      static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(after - lengths_.begin(), 1, last));
  const Vector2d direction = (points_[i] - points_[i - 1]).normalized();
  return {.position = points_[i - 1] + (distance - lengths_[i - 1]) * direction,
          .velocity = rate * direction,
          .acceleration = acceleration * direction};
}

std::vector<LinePart> parts_of(const PenStroke& stroke, double speed, Seconds ramp) {
  constexpr double kSharp = 0.3;  // [rad]
  std::vector<LinePart> parts;
  PenStroke part{stroke.front()};
  for (std::size_t i = 1; i < stroke.size(); ++i) {
    part.push_back(stroke[i]);
    if (i + 1 < stroke.size()) {
      const Vector2d before = (stroke[i] - stroke[i - 1]).normalized();
      const Vector2d after = (stroke[i + 1] - stroke[i]).normalized();
      if (before.dot(after) > std::cos(kSharp)) continue;
    }
    parts.emplace_back(std::exchange(part, {stroke[i]}), speed, ramp);
  }
  return parts;
}

}  // namespace trifinger::manipulation
