// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/control/motion.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::control {

// A point that has made `progress` on the straight line from `start` along `displacement`.
inline PointMotion on_line(const Eigen::Vector3d& start, const Eigen::Vector3d& displacement,
                           const Progress& progress) noexcept {
  return {start + progress.value * displacement, progress.rate * displacement,
          progress.acceleration * displacement};
}

}  // namespace trifinger::control
