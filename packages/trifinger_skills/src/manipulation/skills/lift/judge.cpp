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
      lift_row("lift-pushed", "the same, 1 N for 50 ms from any side while held",
               "18 of 20 not dropped", 0.9, trial, {}, {.hold = control::Seconds(10)});
  pushed.vary = [](SkillTrial& made, std::uint64_t seed) {
    made = varied(made, seed);
    push_from_any_side(made, seed);
  };
  constexpr double kHeavy = 0.25;  // [kg]
  SkillRow heavy = lift_row(
      "lift-heavy", "lift a cube of 0.25 kg 10 cm, hold 5 s, lower; friction 1.0", "18 of 20", 0.9,
      make_skill_trial("sim", "lift", {"fingers.height=0.3", "objects.0.mass=0.25"},
                       {"lift.height=0.1", "lift.hold_time=5", "grasp.friction=0.8",
                        "grasp.slip_friction=0.9", "lift.planned_friction=0.8"}),
      {}, {.height = 0.1, .hold = control::Seconds(5)});
  heavy.vary = [](SkillTrial& made, std::uint64_t seed) {
    made = varied(made, seed);
    made.simulation.description.objects.front().mass = kHeavy;
    made.simulation.description.contact.tip_friction = 1.0;
  };
  return {
      lift_row("lift", "lift a cube 20 cm in 3 s, hold 15 s, lower",
               "18 of 20; 1.5 mm, 2.5° rms, drift 1 mm", 0.9, trial, slow),
      lift_row("lift-fast", "the same in 1 s", "18 of 20; 4 mm rms", 0.9,
               make_skill_trial("sim", "lift", raised, {"lift.time=1", "grasp.tip_stiffness=200"}),
               {.position_rms = 4.0e-3}),
      std::move(pushed),
      lift_row("lift-pro", "`pro`: lift 16.5 cm in 3 s, hold 15 s, lower",
               "18 of 20; 1.5 mm, 2.5° rms, drift 1 mm", 0.9,
               make_skill_trial("trifinger_pro", "lift", {"objects=[{name: cube, type: cube}]"}),
               slow, {.height = 0.165}),
      std::move(heavy)};
}

}  // namespace trifinger::evaluation
