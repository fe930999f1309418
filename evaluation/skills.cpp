// SPDX-License-Identifier: BSD-3-Clause
// `./run evaluate skills`: every skill, in simulations that vary what no controller knows. Prints a
// table of the results. The exit status says whether the table holds.
#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "evaluation/rows.hpp"
#include "evaluation/skill_rows.hpp"
#include "trifinger/realtime/processors.hpp"

namespace trifinger::evaluation {
namespace {

struct JudgedRow {
  SkillRow row;
  std::vector<Judgement> judgements;

  [[nodiscard]] auto successes() const {
    return std::ranges::count_if(judgements, &Judgement::succeeds);
  }
  [[nodiscard]] bool holds() const {
    const double needed = row.needed * static_cast<double>(judgements.size());
    return static_cast<double>(successes()) >= std::ceil(needed - 1e-9) &&
           (!row.together || row.together(judgements));
  }
  // The worst, the middle and the best figure, in the unit of the table.
  [[nodiscard]] std::string spread() const {
    std::vector<double> figures;
    figures.reserve(judgements.size());
    for (const Judgement& judgement : judgements) figures.push_back(judgement.figure * row.scale);
    std::ranges::sort(figures);
    return fmt::format("{:.3g} to {:.3g}, median {:.3g} {}", figures.front(), figures.back(),
                       figures[figures.size() / 2], row.unit);
  }
};

// Runs the trials of a row on all processors; those in real time one after the other.
JudgedRow judged(const Options& options, SkillRow row) {
  std::vector<Judgement> judgements(
      static_cast<std::size_t>(std::min(options.seeds, row.most_trials)));
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < judgements.size(); i = next++) {
      SkillTrial trial = row.trial;
      row.vary(trial, options.first_seed + i);
      try {
        judgements[i] = row.judge(trial, run_skill_trial(trial));
      } catch (const std::exception& error) {
        judgements[i].why = error.what();
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    const unsigned count = row.trial.real_time ? 1U : static_cast<unsigned>(num_processors());
    threads.reserve(count);
    for (unsigned i = 0; i < count; ++i) threads.emplace_back(work);
  }
  JudgedRow done{std::move(row), std::move(judgements)};
  fmt::print("{:<62} {:>3} of {:<3} {:<14} {}: {}\n", done.row.what, done.successes(),
             done.judgements.size(), done.holds() ? "holds" : "DOES NOT HOLD", done.row.figure,
             done.spread());
  for (std::size_t i = 0; i < done.judgements.size(); ++i) {
    const Judgement& judgement = done.judgements[i];
    if (!judgement.succeeds) fmt::print("  seed {}: {}\n", options.first_seed + i, judgement.why);
    if (!judgement.note.empty())
      fmt::print("  seed {}: {}\n", options.first_seed + i, judgement.note);
  }
  std::fflush(stdout);
  return done;
}

std::string page(const Options& options, const std::vector<JudgedRow>& rows) {
  std::string text = fmt::format(
      "<!-- SPDX-License-Identifier: BSD-3-Clause -->\n# Skills: results\n\n"
      "Written by `./run evaluate skills --seeds {} --first-seed {}`. Each trial is a simulation "
      "of "
      "its own that differs in mass, friction,\ndelay and noise of the poses and in the start "
      "([how](../skills.md)); the controller knows none of it. It is judged by what was true\n"
      "in the simulation, not by what the skill saw.\n\n"
      "| what | reach | succeed | figure | holds |\n|---|---|---|---|---|\n",
      options.seeds, options.first_seed);
  for (const JudgedRow& done : rows) {
    text += fmt::format("| {} | {} | {} of {} | {}: {} | {} |\n", done.row.what, done.row.reach,
                        done.successes(), done.judgements.size(), done.row.figure, done.spread(),
                        done.holds() ? "yes" : "**no**");
  }
  for (const JudgedRow& done : rows) {
    text += fmt::format("\n## {}\n\n| seed | {} [{}] | |\n|---|---|---|\n", done.row.what,
                        done.row.figure, done.row.unit);
    for (std::size_t i = 0; i < done.judgements.size(); ++i) {
      const Judgement& judgement = done.judgements[i];
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
  return run_evaluation("skills", "Carries out every skill, and writes what came out.",
                        {.first_seed = 700, .output = "docs/results/skills.md"}, words, evaluate);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  return trifinger::evaluation::run_program({arguments + 1, arguments + argument_count});
}
