// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/joint/limits.hpp"

namespace trifinger::apps::test {

// Limits of joints like those of a TriFinger.
inline std::vector<JointLimit> limits_of_joints(std::size_t count) {
  JointLimit limit;
  limit.max_torque = 0.36;
  limit.safety_kd = 0.09;
  limit.soft_lower = -1.0;
  limit.soft_upper = 1.5;
  limit.hard_lower = -1.5;
  limit.hard_upper = 2.0;
  limit.default_kp = 9.0;
  limit.default_kd = 0.01;
  limit.max_velocity = 5.0;
  return std::vector<JointLimit>(count, limit);
}

}  // namespace trifinger::apps::test
