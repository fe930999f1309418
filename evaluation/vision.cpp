// SPDX-License-Identifier: BSD-3-Clause
// `./run evaluate vision`: lifts and slides a cube that is only seen by cameras. Everything that is
// not known in advance is varied. Writes a table of the results. The exit status says whether it
// holds.
#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "evaluation/cube_trial.hpp"

namespace trifinger::evaluation {
namespace {

constexpr TimeIndex kPeriod = 33;  // [ms], of images
constexpr TimeIndex kDelay = 35;   // [ms], from an image to the pose in it

std::vector<std::string> with(std::vector<std::string> settings, const char* more) {
  settings.emplace_back(more);
  return settings;
}

// The robot that sees, and one that knows the exact poses as late and as seldom.
struct Pair {
  SkillTrial seeing;
  SkillTrial knowing;
};

Pair make_pair(const std::vector<std::string>& settings, const std::string& task,
               const std::vector<std::string>& task_settings) {
  const std::vector<std::string> seeing_settings =
      with(with(settings, "cameras.rate=30"), "cameras.delay=0.035");
  return {.seeing = make_skill_trial("sim_tracked", task, seeing_settings, task_settings),
          .knowing = make_skill_trial("sim", task, settings, task_settings)};
}

SkillRow seeing(std::string what, std::string reach, const Pair& pair, const Limits& limits = {}) {
  return cube_row(std::move(what), std::move(reach), 0.95, pair.seeing, limits);
}

SkillRow knowing(std::string what, const Pair& pair) {
  SkillRow row = cube_row(std::move(what), "for comparison", 0.0, pair.knowing);
  row.vary = [](SkillTrial& trial, std::uint64_t seed) {
    trial = varied(trial, seed);
    trial.simulation.object_period = kPeriod;
    trial.simulation.object_delay = kDelay;
    trial.simulation.object_position_noise = 0;
    trial.simulation.object_orientation_noise = 0;
  };
  return row;
}

std::string page(const Options& options, const std::vector<JudgedRow>& rows) {
  std::string text = fmt::format(
      "<!-- SPDX-License-Identifier: BSD-3-Clause -->\n# Lifting and sliding by sight: results\n\n"
      "Written by `{}`. The cube is known only from "
      "the images of three\n"
      "simulated cameras, 540 x 540 pixels at 30 Hz; its poses are 35 ms old. Light, colours, "
      "dust, noise and gain vary, and the\n"
      "calibration is 0.5 pixels off. Start, mass and friction vary as in "
      "[control.md](control.md). "
      "It is judged by the true poses.\n\n",
      options.command("vision"));
  text += cube_columns();
  for (const JudgedRow& done : rows) text += line_of(done);
  for (const JudgedRow& done : rows) text += details_of(done, options.first_seed);
  return text;
}

int evaluate(const Options& options) {
  const Limits near{.position_rms = 3 * kMillimetre};
  const Pair lift = make_pair({"fingers.height=0.3"}, "lift", {"lift.height=0.15"});
  const Pair high = make_pair({"fingers.height=0.3"}, "lift", {"lift.height=0.2"});
  const Pair slide = make_pair({}, "slide", {});
  std::vector<JudgedRow> rows;
  for (const SkillRow& row :
       {seeing("lift 15 cm, by sight", "95 %; 3 mm", lift, near),
        knowing("lift 15 cm, poses exact and as late", lift),
        seeing("slide on a circle of 5 cm, by sight", "95 %; 3 mm", slide, near),
        knowing("slide, poses exact and as late", slide),
        seeing("lift 20 cm, out of sight at the top", "95 % put back", high)})
    rows.push_back(judged(options, row));
  write_page(options.output, page(options, rows));
  return std::ranges::all_of(rows, &JudgedRow::holds) ? 0 : 1;
}

int run_program(const std::vector<std::string>& words) {
  return run_evaluation("vision", "Lifts and slides cubes that are only seen by cameras.",
                        {.output = "docs/results/vision.md"}, words, evaluate);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  return trifinger::evaluation::run_program({arguments + 1, arguments + argument_count});
}
