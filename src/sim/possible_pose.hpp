// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "trifinger/sim/object_observation.hpp"

namespace trifinger::detail {

/// True if an object can be put there: all numbers are finite, and the quaternion, of any length,
/// is not zero.
[[nodiscard]] inline bool is_possible(const ObjectPose& pose) noexcept {
  constexpr double kSmallestSquare = 1e-12;
  double square = 0.0;
  for (const double value : pose.orientation) square += value * value;
  return std::isfinite(square) && square > kSmallestSquare &&
         std::ranges::all_of(pose.position, [](double value) { return std::isfinite(value); });
}

}  // namespace trifinger::detail
