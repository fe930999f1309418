// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <initializer_list>

#include "trifinger/control/motion.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::manipulation {

// The trajectory of one tip along straight legs, from rest to rest on each.
class TipTrajectory {
 public:
  static constexpr std::size_t kMaxLegs = 4;

  // Stays at `point`.
  void rest_at(const Eigen::Vector3d& point) noexcept {
    from_ = to_ = now_ = point;
    next_ = legs_ = 0;
    time_ = duration_ = control::Seconds(0);
  }

  // Goes through at most kMaxLegs `points` from where the tip should be now, with a mean `speed`
  // [m/s].
  void begin(std::initializer_list<Eigen::Vector3d> points, double speed) noexcept {
    next_ = legs_ = 0;
    for (const Eigen::Vector3d& point : points) {
      if (legs_ < kMaxLegs) points_[legs_++] = point;
    }
    speed_ = speed;
    from_ = to_ = now_;
    time_ = duration_ = control::Seconds(0);
    begin_leg();
  }

  [[nodiscard]] bool is_complete() const noexcept { return next_ == legs_ && time_ >= duration_; }

  // Where the tip should be after another `elapsed`.
  control::PointMotion advance(control::Seconds elapsed) noexcept {
    time_ += elapsed;
    if (time_ >= duration_ && next_ < legs_) begin_leg();
    const control::Progress progress = control::minimum_jerk(time_, duration_);
    const Eigen::Vector3d leg = to_ - from_;
    now_ = from_ + progress.value * leg;
    return {.position = now_,
            .velocity = progress.rate * leg,
            .acceleration = progress.acceleration * leg};
  }

 private:
  void begin_leg() noexcept {
    if (next_ == legs_) return;
    from_ = to_;
    to_ = points_[next_++];
    duration_ = control::Seconds((to_ - from_).norm() / speed_);
    time_ = control::Seconds(0);
  }

  std::array<Eigen::Vector3d, kMaxLegs> points_{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                                Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  std::size_t legs_{0};
  std::size_t next_{0};
  double speed_{0.1};
  Eigen::Vector3d from_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d to_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d now_{Eigen::Vector3d::Zero()};
  control::Seconds time_{0};
  control::Seconds duration_{0};
};

}  // namespace trifinger::manipulation
