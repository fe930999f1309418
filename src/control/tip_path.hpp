// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>

#include "line.hpp"
#include "trifinger/control/grasp.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::control {

// Moves all tips along straight legs, with a rest at the end of each leg. All tips arrive together.
class TipPath {
 public:
  using Points = std::array<Eigen::Vector3d, kContacts>;

  static constexpr std::size_t kLegs = 2;

  // `speed` is the mean speed of the tip with the longest leg [m/s].
  explicit TipPath(double speed) : speed_(speed) {}

  // Stays at `points`.
  void rest_at(const Points& points) noexcept {
    from_ = to_ = points;
    next_ = kLegs;
    time_ = duration_ = Seconds(0);
  }

  // Goes through `points`, starting where the tips should be now.
  void begin(const std::array<Points, kLegs>& points) noexcept {
    points_ = points;
    next_ = 0;
    begin_leg();
  }

  [[nodiscard]] bool is_complete() const noexcept { return next_ == kLegs && time_ >= duration_; }

  // Advances the path by `elapsed`. Returns where the tips should be then.
  std::array<PointMotion, kContacts> advance(Seconds elapsed) noexcept {
    time_ += elapsed;
    if (time_ >= duration_ && next_ < kLegs) begin_leg();
    const Progress progress = minimum_jerk(time_, duration_);
    std::array<PointMotion, kContacts> motions;
    for (std::size_t k = 0; k < motions.size(); ++k)
      motions[k] = on_line(from_[k], to_[k] - from_[k], progress);
    return motions;
  }

 private:
  void begin_leg() noexcept {
    from_ = to_;
    to_ = points_[next_++];
    double length = 0.0;
    for (std::size_t k = 0; k < to_.size(); ++k)
      length = std::max(length, (to_[k] - from_[k]).norm());
    duration_ = Seconds(length / speed_);
    time_ = Seconds(0);
  }

  static Points at_origin() noexcept {
    Points points;
    points.fill(Eigen::Vector3d::Zero());
    return points;
  }

  double speed_;
  std::array<Points, kLegs> points_{at_origin(), at_origin()};
  std::size_t next_{kLegs};  // Index of the leg after `to_`.
  Points from_{at_origin()};
  Points to_{at_origin()};
  Seconds time_{0};
  Seconds duration_{0};
};

}  // namespace trifinger::control
