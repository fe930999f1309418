// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/rows.hpp"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <exception>
#include <span>
#include <thread>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/base/regular_file.hpp"
#include "trifinger/realtime/processors.hpp"

namespace trifinger::evaluation {
namespace {

void tell(const Row& row) {
  fmt::print("{:<62} {:>3} of {:<3} {}\n", row.what, row.successes(), row.reports.size(),
             row.holds() ? "holds" : "DOES NOT HOLD");
  std::fflush(stdout);
}

}  // namespace

std::vector<Report> run_all(const Options& options,
                            const std::function<SkillTrial(std::uint64_t seed)>& trial_of) {
  std::vector<Report> reports(static_cast<std::size_t>(options.seeds));
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::atomic_flag has_failed;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < reports.size(); i = next++) {
        SkillTrialResult result = run_skill_trial(trial_of(options.first_seed + i));
        reports[i] = {.failure = std::string(result.trace.failure),
                      .figures = std::move(result.figures)};
      }
    } catch (...) {
      if (!has_failed.test_and_set()) failure = std::current_exception();
      next = reports.size();
    }
  };
  {
    std::vector<std::jthread> threads(static_cast<std::size_t>(num_processors()));
    for (std::jthread& thread : threads) thread = std::jthread(work);
  }
  if (failure) std::rethrow_exception(failure);
  return reports;
}

Row run_row(const Options& options, Row row,
            const std::function<SkillTrial(std::uint64_t seed)>& trial_of) {
  row.reports = run_all(options, trial_of);
  tell(row);
  return row;
}

std::string line_of(const Row& row) {
  return fmt::format(
      "| {} | {} | {} of {} | {:.2f} mm | {:.2f}° | {} | {:.2f} to {:.2f} N | {:.0f} % | {} |\n",
      row.what, row.reach, row.successes(), row.reports.size(),
      row.worst("position_rms") / kMillimetre, row.worst("orientation_rms") / kDegree,
      row.worst("hold_drift") > 0.0
          ? fmt::format("{:.2f} mm", row.worst("hold_drift") / kMillimetre)
          : "",
      row.least("normal_force_min"), row.worst("normal_force_max"),
      100 * row.least("torque_margin"), row.holds() ? "yes" : "**no**");
}

std::string details_of(const Row& row, std::uint64_t first_seed) {
  std::string text = fmt::format(
      "\n## {}\n\n| seed | position rms, max [mm] | orientation rms, max [°] | drift, slip while "
      "held [mm] | normal force "
      "[N] | tangential force [N] | torque left [%] | grasps | "
      "|\n|---|---|---|---|---|---|---|---|---|\n",
      row.what);
  for (std::size_t i = 0; i < row.reports.size(); ++i) {
    const Report& r = row.reports[i];
    text += fmt::format(
        "| {} | {:.2f}, {:.2f} | {:.2f}, {:.2f} | {:.2f}, {:.2f} | {:.2f} to {:.2f} | {:.2f} | "
        "{:.0f} | {:.0f} | {} |\n",
        first_seed + i, r.at("position_rms") / kMillimetre, r.at("position_max") / kMillimetre,
        r.at("orientation_rms") / kDegree, r.at("orientation_max") / kDegree,
        r.at("hold_drift") / kMillimetre, r.at("hold_slip") / kMillimetre, r.at("normal_force_min"),
        r.at("normal_force_max"), r.at("tangential_force_max"), 100 * r.at("torque_margin"),
        r.at("grasps"),
        !r.failure.empty() ? r.failure
        : row.succeeds(r)  ? ""
                           : "beyond the reach");
  }
  return text;
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
  program.add_option("ONLY", options.only, "Skills, if not all; the table is then printed only");
  try {
    program.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::ParseError& error) {
    return program.exit(error);
  }
  try {
    return evaluate(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "evaluate {}: {}\n", name, error.what());
    return 1;
  }
}

}  // namespace trifinger::evaluation
