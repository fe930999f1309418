// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/rows.hpp"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <span>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "base/regular_file.hpp"
#include "realtime/processors.hpp"

namespace trifinger::evaluation {

int JudgedRow::successes() const {
  return static_cast<int>(std::ranges::count_if(
      reports, [](const Report& report) { return report.judgement.succeeds; }));
}

bool JudgedRow::holds() const {
  const double needed = row.needed * static_cast<double>(reports.size());
  return successes() >= std::ceil(needed - 1e-9) && (!row.together || row.together(reports));
}

std::string JudgedRow::spread() const {
  std::vector<double> figures;
  figures.reserve(reports.size());
  for (const Report& report : reports) figures.push_back(report.judgement.figure * row.scale);
  std::ranges::sort(figures);
  return fmt::format("{:.3g} to {:.3g}, median {:.3g} {}", figures.front(), figures.back(),
                     figures[figures.size() / 2], row.unit);
}

double JudgedRow::worst(std::string_view figure) const {
  double worst = 0.0;
  for (const Report& report : reports) worst = std::max(worst, report.at(figure));
  return worst;
}

double JudgedRow::least(std::string_view figure) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Report& report : reports) least = std::min(least, report.at(figure));
  return least;
}

std::string Options::command(const std::string& name) const {
  std::string words =
      fmt::format("./run evaluate {} --seeds {} --first-seed {}", name, seeds, first_seed);
  if (condition != Condition::kAsDocumented) {
    words += fmt::format(" --condition \"{}\"", name_of(condition));
  }
  for (const auto& [what, value] : changes) words += fmt::format(" --vary {}={:g}", what, value);
  return words;
}

std::vector<Report> run_all(const Options& options, const SkillRow& row) {
  std::vector<Report> reports(static_cast<std::size_t>(std::min(options.seeds, row.most_trials)));
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < reports.size(); i = next++) {
      SkillTrial trial = row.trial;
      row.vary(trial, options.first_seed + i);
      trial.condition = options.condition;
      trial.changes = options.changes;
      try {
        SkillTrialResult result = run_skill_trial(trial);
        reports[i] = {.judgement = row.judge(trial, result), .figures = std::move(result.figures)};
      } catch (const std::exception& error) {
        reports[i].judgement.why = error.what();
      }
    }
  };
  std::vector<std::jthread> threads;
  const unsigned count = row.trial.real_time ? 1U : static_cast<unsigned>(num_processors());
  threads.reserve(count);
  for (unsigned i = 0; i < count; ++i) threads.emplace_back(work);
  threads.clear();  // Waits for them.
  return reports;
}

JudgedRow judged(const Options& options, SkillRow row) {
  std::vector<Report> reports = run_all(options, row);
  JudgedRow done{std::move(row), std::move(reports)};
  fmt::print("{:<62} {:>3} of {:<3} {:<14} {}: {}\n", done.row.what, done.successes(),
             done.reports.size(), done.holds() ? "holds" : "DOES NOT HOLD", done.row.figure,
             done.spread());
  for (std::size_t i = 0; i < done.reports.size(); ++i) {
    const Judgement& judgement = done.reports[i].judgement;
    if (!judgement.succeeds) fmt::print("  seed {}: {}\n", options.first_seed + i, judgement.why);
    if (!judgement.note.empty())
      fmt::print("  seed {}: {}\n", options.first_seed + i, judgement.note);
  }
  std::fflush(stdout);
  return done;
}

void write_page(const std::filesystem::path& path, const std::string& page) {
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
  replace_file(path, std::as_bytes(std::span(page)));
  fmt::print("{} written.\n", path.string());
}

int run_evaluation(const std::string& name, const std::string& what, Options options,
                   const std::vector<std::string>& words,
                   const std::function<int(const Options&)>& evaluate) {
  CLI::App program(what, "evaluate " + name);
  program.add_option("--seeds", options.seeds, "Trials of each kind")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  program.add_option("--first-seed", options.first_seed, "Seed of the first")
      ->capture_default_str();
  program.add_option("--output", options.output, "Where the table goes")->capture_default_str();
  std::string condition{name_of(options.condition)};
  program.add_option("--condition", condition, "'as documented', 'as built' or 'worn'")
      ->capture_default_str();
  const auto add_changes = [&options](const std::vector<std::string>& changes) {
    for (const std::string& change : changes) {
      const std::size_t equals = std::min(change.find('='), change.size());
      const std::string_view number =
          std::string_view(change).substr(equals).substr(equals < change.size());
      double value = 0.0;
      const auto [end, error] = std::from_chars(number.begin(), number.end(), value);
      if (error != std::errc() || end != number.end()) {
        throw CLI::ValidationError("--vary", "write NAME=VALUE, such as backlash=0.004");
      }
      options.changes.emplace_back(change.substr(0, equals), value);
    }
  };
  program
      .add_option_function<std::vector<std::string>>(
          "--vary", add_changes,
          "NAME=VALUE of trifinger.Variation, the same in every robot; repeatable")
      ->allow_extra_args(false);
  program.add_option("ONLY", options.only, "Skills, if not all; the table is then printed only");
  try {
    program.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::ParseError& error) {
    return program.exit(error);
  }
  try {
    options.condition = condition_from_name(condition);
    Variation checked;
    for (const auto& [field, value] : options.changes) set_value(checked, field, value);
    checked.validate();
    return evaluate(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "evaluate {}: {}\n", name, error.what());
    return 1;
  }
}

}  // namespace trifinger::evaluation
