// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include "trifinger/base/time.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// The mean of the poses of an object at rest. The mean of quaternions of one sign is the mean
// orientation up to second order in their distances.
class PoseAverage {
 public:
  // Forgets all poses. Only those that were captured at `from` or later count from now on.
  void restart(TimeIndex from) noexcept {
    *this = {};
    from_ = from;
  }

  void add(TimeIndex captured, const control::Pose& pose) noexcept {
    if (captured >= from_) add(pose);
  }

  void add(const control::Pose& pose) noexcept {
    const Eigen::Vector4d coefficients = pose.orientation.coeffs();
    if (!pose.position.allFinite() || !coefficients.allFinite()) return;
    ++count_;
    position_ += pose.position;
    orientation_ += orientation_.dot(coefficients) < 0 ? -coefficients : coefficients;
  }

  [[nodiscard]] int count() const noexcept { return count_; }

  // Only if poses were added.
  [[nodiscard]] control::Pose mean() const noexcept {
    return {.position = position_ / count_,
            .orientation = Eigen::Quaterniond(Eigen::Vector4d(orientation_.normalized()))};
  }

 private:
  TimeIndex from_{0};
  int count_{0};
  Eigen::Vector3d position_{Eigen::Vector3d::Zero()};
  Eigen::Vector4d orientation_{Eigen::Vector4d::Zero()};
};

}  // namespace trifinger::manipulation
