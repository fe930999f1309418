// SPDX-License-Identifier: BSD-3-Clause
#include <vector>

#include "evaluation/cube_trial.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {

std::vector<SkillRow> slide_rows() {
  const Limits limits{.position_rms = 1.5e-3, .orientation_rms = 1.5 * kDegree};
  return {
      slide_row("slide", "slide a cube on a circle of 5 cm, 3 turns of 4 s",
                "18 of 20; 1.5 mm, 1.5° rms", 0.9, make_skill_trial("sim", "slide"), limits),
      slide_row("slide-pro", "`pro`: slide, likewise", "18 of 20; 1.5 mm, 1.5° rms", 0.9,
                make_skill_trial("trifinger_pro", "slide", {"objects=[{name: cube, type: cube}]"}),
                limits)};
}

}  // namespace trifinger::evaluation
