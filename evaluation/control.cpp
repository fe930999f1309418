// SPDX-License-Identifier: BSD-3-Clause
// `./run evaluate control`: the paper's first experiment. Everything that is not known in advance
// is varied. Prints a table of the results. The exit status says whether the table holds.
#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "evaluation/cube_trial.hpp"
#include "evaluation/skill_rows.hpp"
#include "manipulation/skills/lift/lift.hpp"

namespace trifinger::evaluation {
namespace {

// The same as in `simulated`, over emulated motor boards. Each trial must meet the same limits, and
// the root mean square of all trials together is compared.
JudgedRow run_on_boards(const Options& options, const JudgedRow& simulated, SkillTrial trial) {
  constexpr double kMost = 1.2;
  SkillRow row = simulated.row;
  row.what = "over emulated motor boards: " + row.what;
  row.reach = fmt::format("all likewise; together rms <= {} x of that", kMost);
  row.trial = std::move(trial);
  const double position = together(simulated.reports, "position_rms");
  const double orientation = together(simulated.reports, "orientation_rms");
  row.together = [=](std::span<const Report> reports) {
    return together(reports, "position_rms") <= kMost * position &&
           together(reports, "orientation_rms") <= kMost * orientation;
  };
  JudgedRow done = judged(options, std::move(row));
  fmt::print("  together {:.2f} mm and {:.2f}°, simulated {:.2f} mm and {:.2f}°\n",
             together(done.reports, "position_rms") / kMillimetre,
             together(done.reports, "orientation_rms") / kDegree, position / kMillimetre,
             orientation / kDegree);
  return done;
}

// The heaviest cube that can be lifted by 10 cm from some of the places and held for 5 s.
struct Heaviest {
  double mass{0.0};  // [kg]
  static constexpr double kReach = 0.25;
};

Heaviest find_heaviest(const Options& options) {
  Options few = options;
  few.seeds = std::min(options.seeds, 5);
  Heaviest heaviest;
  constexpr int kFirst = 20;
  constexpr int kLast = 100;
  for (int decagrams = kFirst; decagrams < kLast; ++decagrams) {
    const double mass = 0.01 * decagrams;
    SkillRow row =
        cube_row("", "", 1.0,
                 make_skill_trial("sim", "lift",
                                  {"fingers.height=0.3", fmt::format("objects.0.mass={}", mass)},
                                  {"lift.height=0.1", "lift.hold_time=5", "grasp.friction=0.8",
                                   "grasp.slip_friction=0.9", "lift.planned_friction=0.8"}));
    row.vary = [mass](SkillTrial& trial, std::uint64_t seed) {
      trial = varied(trial, seed);
      trial.simulation.description.objects[0].mass = mass;
      trial.simulation.description.contact.tip_friction = 1.0;
    };
    if (!std::ranges::all_of(run_all(few, row),
                             [](const Report& report) { return report.judgement.succeeds; }))
      break;
    heaviest.mass = mass;
  }
  fmt::print("{:<62} {:.2f} kg    {}\n", "heaviest cube", heaviest.mass,
             heaviest.mass >= Heaviest::kReach ? "holds" : "DOES NOT HOLD");
  std::fflush(stdout);
  return heaviest;
}

std::string page(const Options& options, const std::vector<JudgedRow>& rows,
                 const Heaviest& heaviest, double pro_height) {
  std::string text = fmt::format(
      "<!-- SPDX-License-Identifier: BSD-3-Clause -->\n# Optimal control: results\n\n"
      "Written by `{}`. Each trial is a simulation "
      "of its own with a start of the\n"
      "cube within 3 cm of the centre and any yaw, a mass that is up to 20 % off, tip friction 0.6 "
      "to 1.0, and poses at 100 Hz that\n"
      "are 10 to 30 ms old and have a noise of 1 mm and 0.5° per axis; the controller knows none "
      "of it. It is judged by the true\n"
      "poses, from the begin of the line or circle until the release; a cube that was grasped "
      "again counts as a failure.\n\n",
      options.command("control"));
  text += cube_columns();
  for (const JudgedRow& done : rows) text += line_of(done);
  text += fmt::format(
      "| heaviest cube on `edu`, lifted 10 cm | >= {:.2f} kg | {:.2f} kg | | | | | | {} |\n\n"
      "The heaviest cube is the last that is lifted and held for 5 s from five starts, in steps of "
      "10 g, with a true friction of\n"
      "1.0, a controller that relies on 0.8 and knows the mass. A margin of torque below zero: for "
      "moments more was asked for\n"
      "than the motors give. `pro` reaches {:.3f} m from the centre, however the cube is turned "
      "there, before a finger meets the\n"
      "cube, a joint its soft limit, or a motor its torque.\n",
      Heaviest::kReach, heaviest.mass, heaviest.mass >= Heaviest::kReach ? "yes" : "**no**",
      pro_height);
  for (const JudgedRow& done : rows) text += details_of(done, options.first_seed);
  return text;
}

int evaluate(const Options& options) {
  const SkillTrial pro =
      make_skill_trial("trifinger_pro", "lift", {"objects=[{name: cube, type: cube}]"});
  const manipulation::ManipulationConfig pro_config = manipulation::load_lift(
      {.description = pro.believed, .limits = manipulation::safety_limits_of(pro.simulation)});
  const double pro_height = manipulation::reachable_height(pro.believed, pro_config);
  const double pro_lifted = std::get<manipulation::LiftTask>(pro_config.task).height;
  fmt::print("pro reaches {:.3f} m, config/skills/lift_pro.yml asks for {:.3f} m\n", pro_height,
             pro_lifted);

  std::vector<JudgedRow> rows;
  for (SkillRow& row : lift_rows()) rows.push_back(judged(options, std::move(row)));
  const std::size_t slide = rows.size();
  for (SkillRow& row : slide_rows()) rows.push_back(judged(options, std::move(row)));
  rows.push_back(
      run_on_boards(options, rows[0],
                    make_skill_trial("trifinger_edu_emulated", "lift", {"fingers.height=0.3"})));
  rows.push_back(
      run_on_boards(options, rows[slide], make_skill_trial("trifinger_edu_emulated", "slide")));
  const Heaviest heaviest = find_heaviest(options);

  write_page(options.output, page(options, rows, heaviest, pro_height));
  const bool holds = std::ranges::all_of(rows, &JudgedRow::holds) &&
                     heaviest.mass >= Heaviest::kReach && pro_height >= pro_lifted;
  return holds ? 0 : 1;
}

int run_program(const std::vector<std::string>& words) {
  return run_evaluation("control", "Lifts and slides cubes, and writes what came out.",
                        {.output = "docs/results/control.md"}, words, evaluate);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  return trifinger::evaluation::run_program({arguments + 1, arguments + argument_count});
}
