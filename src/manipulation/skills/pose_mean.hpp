// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// Mean of the poses of an object at rest.
class PoseMean {
 public:
  void clear() noexcept { count_ = 0; }
  void add(const control::Pose& pose) noexcept {
    if (count_++ == 0) {
      mean_ = pose;
      return;
    }
    const double share = 1.0 / count_;
    mean_.position += share * (pose.position - mean_.position);
    const Eigen::Vector3d turn = control::rotation_error(pose.orientation, mean_.orientation);
    mean_.orientation =
        (control::rotation_from_vector(share * turn) * mean_.orientation).normalized();
  }
  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] const control::Pose& mean() const noexcept { return mean_; }

 private:
  control::Pose mean_{};
  int count_{0};
};

}  // namespace trifinger::manipulation
