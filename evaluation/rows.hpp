// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "evaluation/cube_trial.hpp"

namespace trifinger::evaluation {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr double kMillimetre = 1e-3;

struct Options {
  int seeds{20};
  std::uint64_t first_seed{1};
  std::filesystem::path output;
  std::vector<std::string> only{};  // Skills; all if there are none.
};

// Limits that a trial must stay within.
struct Limits {
  double position_rms;     // [m]
  double orientation_rms;  // [rad]
  double hold_drift;       // [m]
};
inline constexpr double kAny = std::numeric_limits<double>::infinity();

// What a trial has come to, by the true poses.
struct Report {
  std::string failure;  // Empty if there is none.
  std::vector<manipulation::Figure> figures;

  // Zero if there is no such figure.
  [[nodiscard]] double at(std::string_view name) const {
    const auto found = std::ranges::find(figures, name, &manipulation::Figure::name);
    return found == figures.end() ? 0.0 : found->value;
  }
  // The first grasp has held until the end.
  [[nodiscard]] bool is_done_at_once() const { return failure.empty() && at("grasps") == 1; }
};

// One line of the table.
struct Row {
  std::string what;
  std::string reach;
  double needed;  // Share of the trials.
  Limits limits;
  std::vector<Report> reports;
  // Limits of all trials together.
  double most_position_rms{kAny};     // [m]
  double most_orientation_rms{kAny};  // [rad]

  [[nodiscard]] bool succeeds(const Report& report) const {
    return report.is_done_at_once() && report.at("position_rms") <= limits.position_rms &&
           report.at("orientation_rms") <= limits.orientation_rms &&
           report.at("hold_drift") <= limits.hold_drift;
  }
  [[nodiscard]] int successes() const {
    return static_cast<int>(
        std::ranges::count_if(reports, [this](const Report& report) { return succeeds(report); }));
  }
  [[nodiscard]] bool holds() const {
    return successes() >= std::ceil(needed * static_cast<double>(reports.size()) - 1e-9) &&
           together("position_rms") <= most_position_rms &&
           together("orientation_rms") <= most_orientation_rms;
  }
  // The root mean square of a figure that is one itself, of all trials.
  [[nodiscard]] double together(std::string_view figure) const {
    double sum = 0.0;
    for (const Report& report : reports) sum += report.at(figure) * report.at(figure);
    return std::sqrt(sum / static_cast<double>(reports.size()));
  }
  [[nodiscard]] double worst(std::string_view figure) const {
    double worst = 0.0;
    for (const Report& report : reports) worst = std::max(worst, report.at(figure));
    return worst;
  }
  [[nodiscard]] double least(std::string_view figure) const {
    double least = kAny;
    for (const Report& report : reports) least = std::min(least, report.at(figure));
    return least;
  }
};

// Returns the reports of `trial_of(seed)`. Uses as many threads as there are processors.
[[nodiscard]] std::vector<Report> run_all(
    const Options& options, const std::function<SkillTrial(std::uint64_t seed)>& trial_of);

// Runs `row` with these trials and prints its line.
[[nodiscard]] Row run_row(const Options& options, Row row,
                          const std::function<SkillTrial(std::uint64_t seed)>& trial_of);

// A row of the table, and the table of its trials, in Markdown.
[[nodiscard]] std::string line_of(const Row& row);
[[nodiscard]] std::string details_of(const Row& row, std::uint64_t first_seed);

// Writes a page. Throws Error.
void write_page(const std::filesystem::path& path, const std::string& page);

// Reads the options of an evaluation from its words and runs it. Returns the exit status.
[[nodiscard]] int run_evaluation(const std::string& name, const std::string& what, Options options,
                                 const std::vector<std::string>& words,
                                 const std::function<int(const Options&)>& evaluate);

}  // namespace trifinger::evaluation
