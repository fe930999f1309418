// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace trifinger::detail {

// What to do about a mass or an inertia that no body can have.
inline constexpr const char* kHowToRepair =
    "robot.repair_inertia: true, or --repair-inertia, takes the nearest that a body can have";

// Moment of inertia of a ball of this mass that is as dense as water [kgm^2].
[[nodiscard]] double ball_inertia(double mass);

// Finds the bodies whose mass or inertia no body can have: moments of inertia that are not
// positive, or of which one is larger than the sum of both others; and moving bodies without a
// mass. Each text names a body. `repairs` also gives them the nearest moments that are possible,
// none of them smaller than it was, and 1 g if they have no mass.
[[nodiscard]] std::vector<std::string> find_impossible_inertias(mjSpec* spec, bool repairs);

}  // namespace trifinger::detail
