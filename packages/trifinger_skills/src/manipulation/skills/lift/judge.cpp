// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <vector>

#include "evaluation/cube_trial.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {

std::vector<SkillRow> lift_rows() {
  const Limits slow{.position_rms = 1.5e-3, .orientation_rms = 2.5 * kDegree, .hold_drift = 1.0e-3};
  const std::vector<std::string> raised{"fingers.height=0.3"};
  const SkillTrial trial = make_skill_trial("sim", "lift", raised);
  SkillRow pushed =
      cube_row("1 N for 50 ms from any side while held", "90 % not dropped", 0.9, trial);
  pushed.vary = [](SkillTrial& made, std::uint64_t seed) {
    made = varied(made, seed);
    push_from_any_side(made, seed);
  };
  return {
      cube_row("lift 20 cm in 3 s, hold 15 s, lower", "all; 1.5 mm, 2.5°, drift 1 mm", 1.0, trial,
               slow),
      cube_row("the same in 1 s", "90 %; 4 mm", 0.9,
               make_skill_trial("sim", "lift", raised, {"lift.time=1", "grasp.tip_stiffness=200"}),
               {.position_rms = 4.0e-3}),
      pushed,
      cube_row(
          "`pro`: lift 16.5 cm in 3 s, hold 15 s, lower", "90 %; 1.5 mm, 2.5°, drift 1 mm", 0.9,
          make_skill_trial("trifinger_pro", "lift", {"objects=[{name: cube, type: cube}]"}), slow)};
}

}  // namespace trifinger::evaluation
