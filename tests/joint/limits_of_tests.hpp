// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "trifinger/joint/limits.hpp"

namespace trifinger::test {

inline constexpr double kOff = std::numeric_limits<double>::infinity();

/// Limits of N joints that differ from joint to joint, so that a mixed-up index is noticed.
/// Everything that can be switched off is off.
template <std::size_t N>
JointLimits<N> some_limits() {
  JointLimits<N> limits{};
  for (std::size_t i = 0; i < N; ++i) {
    const double step = 0.01 * static_cast<double>(i);
    limits.max_torque[i] = 0.36 + step;
    limits.safety_kd[i] = 0.09 - step;
    limits.soft_lower[i] = -1.0 - step;
    limits.soft_upper[i] = 1.5 + step;
    limits.hard_lower[i] = -2.0 - step;
    limits.hard_upper[i] = 2.5 + step;
    limits.default_kp[i] = 7.0 + step;
    limits.default_kd[i] = 0.02 + step;
    limits.max_kp[i] = 50.0 + step;
    limits.max_kd[i] = 0.5 + step;
    limits.max_velocity[i] = kOff;
    limits.braking[i] = kOff;
    limits.max_torque_rate[i] = kOff;
    limits.continuous_torque[i] = kOff;
    limits.thermal_time[i] = kOff;
  }
  limits.plausibility = {.max_position_rate = detail::filled<N>(kOff),
                         .max_velocity_error = detail::filled<N>(kOff),
                         .velocity_error_time = detail::filled<N>(kOff),
                         .stuck_torque = detail::filled<N>(kOff),
                         .stuck_time = detail::filled<N>(kOff)};
  return limits;
}

}  // namespace trifinger::test
