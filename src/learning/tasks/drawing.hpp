// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <numbers>

#include "trifinger/base/random.hpp"

namespace trifinger::learning {

// Number of tries until something fits; if nothing does, the last one is taken.
inline constexpr int kDraws = 1000;

// Draws a point in a disc about the centre of the table; all of its points are equally probable.
inline void draw_in_disc(Random& random, double radius, double* xy) noexcept {
  const double distance = radius * std::sqrt(random.uniform(0.0, 1.0));
  const double angle = random.uniform(0.0, 2 * std::numbers::pi);
  xy[0] = distance * std::cos(angle);
  xy[1] = distance * std::sin(angle);
}

}  // namespace trifinger::learning
