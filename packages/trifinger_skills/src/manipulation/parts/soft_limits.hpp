// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "trifinger/control/safety_limits.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// Distance that joints keep from their soft limits [rad].
inline constexpr double kLimitMargin = 0.05;

// Whether all joints of a finger keep `margin` [rad] from their soft limits.
[[nodiscard]] inline bool is_within_soft_limits(const FingerPose& pose, int finger,
                                                const control::SafetyLimits& limits,
                                                double margin) noexcept {
  for (int i = 0; i < kJointsPerFinger; ++i) {
    const int index = kJointsPerFinger * finger + i;
    const auto joint = static_cast<std::size_t>(index);
    if (pose.position[i] < limits.soft_lower[joint] + margin ||
        pose.position[i] > limits.soft_upper[joint] - margin)
      return false;
  }
  return true;
}

}  // namespace trifinger::manipulation
