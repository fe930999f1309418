// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// How well an object was handled with three tips, from the beginning of its line or circle until
// its release. `hold_...` is about the time when it is held at the end of a line. Only `num_poses`
// if it was never handled.
[[nodiscard]] std::vector<Figure> grasp_figures(const SkillTrace& trace,
                                                std::span<const SeenPose> poses);

}  // namespace trifinger::manipulation
