// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "trifinger/joint/limits.hpp"

namespace trifinger::test {

inline constexpr double kOff = std::numeric_limits<double>::infinity();

/// True for NaN, also at compile time, where std::isnan cannot be called.
constexpr bool is_not_given(double value) { return !(value <= kOff); }

/// Switches off every value of `limit` that can be switched off and is not given.
constexpr JointLimit with_the_rest_off(JointLimit limit) {
  for (const JointLimitField& field : JointLimit::fields()) {
    if (field.may_be_infinite() && is_not_given(limit.*field.value)) limit.*field.value = kOff;
  }
  return limit;
}

/// Limits of N joints that differ from joint to joint, so that a mixed-up index is noticed.
/// Everything that can be switched off is off.
template <std::size_t N>
JointLimits<N> some_limits() {
  JointLimits<N> limits;
  for (std::size_t i = 0; i < N; ++i) {
    const double step = 0.01 * static_cast<double>(i);
    limits[i] = with_the_rest_off({.max_torque = 0.36 + step,
                                   .safety_kd = 0.09 - step,
                                   .soft_lower = -1.0 - step,
                                   .soft_upper = 1.5 + step,
                                   .hard_lower = -2.0 - step,
                                   .hard_upper = 2.5 + step,
                                   .default_kp = 7.0 + step,
                                   .default_kd = 0.02 + step,
                                   .max_kp = 50.0 + step,
                                   .max_kd = 0.5 + step});
  }
  return limits;
}

}  // namespace trifinger::test
