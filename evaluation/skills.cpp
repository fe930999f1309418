// SPDX-License-Identifier: BSD-3-Clause
// `./run evaluate skills`: every skill, in simulations that vary what no controller knows. Prints a
// table of the results. The exit status says whether the table holds.
#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "evaluation/rows.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

std::string page(const Options& options, const std::vector<JudgedRow>& rows) {
  std::string text = fmt::format(
      "<!-- SPDX-License-Identifier: BSD-3-Clause -->\n# Skills: results\n\n"
      "Written by `{}`. Each trial is a simulation "
      "of "
      "its own that differs in mass, friction,\ndelay and noise of the poses and in the start "
      "([how](../skills.md)); the controller knows none of it. It is judged by what was true\n"
      "in the simulation, not by what the skill saw.\n\n"
      "| what | reach | succeed | figure | holds |\n|---|---|---|---|---|\n",
      options.command("skills"));
  for (const JudgedRow& done : rows) {
    text += fmt::format("| {} | {} | {} of {} | {}: {} | {} |\n", done.row.what, done.row.reach,
                        done.successes(), done.reports.size(), done.row.figure, done.spread(),
                        done.holds() ? "yes" : "**no**");
  }
  for (const JudgedRow& done : rows) {
    text += fmt::format("\n## {}\n\n| seed | {} [{}] | |\n|---|---|---|\n", done.row.what,
                        done.row.figure, done.row.unit);
    for (std::size_t i = 0; i < done.reports.size(); ++i) {
      const Judgement& judgement = done.reports[i].judgement;
      const std::string_view between = judgement.why.empty() || judgement.note.empty() ? "" : "; ";
      text +=
          fmt::format("| {} | {:.4g} | {}{}{} |\n", options.first_seed + i,
                      judgement.figure * done.row.scale, judgement.why, between, judgement.note);
    }
  }
  return text;
}

int evaluate(const Options& options) {
  std::vector<JudgedRow> rows;
  for (SkillRow& row : all_skill_rows()) {
    const bool is_wanted = options.only.empty() ||
                           std::ranges::find(options.only, row.trial.skill) != options.only.end();
    if (is_wanted) rows.push_back(judged(options, std::move(row)));
  }
  // A part of the table does not replace the whole one.
  if (options.only.empty()) write_page(options.output, page(options, rows));
  return std::ranges::all_of(rows, &JudgedRow::holds) ? 0 : 1;
}

int run_program(const std::vector<std::string>& words) {
  return run_evaluation("skills", "Runs every skill, and writes what came out.",
                        {.first_seed = 700, .output = "docs/results/skills.md"}, words, evaluate);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  return trifinger::evaluation::run_program({arguments + 1, arguments + argument_count});
}
