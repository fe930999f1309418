// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "evaluation/skill_trial.hpp"

// How rows of a table are run, whichever skill they are about.
namespace trifinger::evaluation {

struct Options {
  int seeds{20};
  std::uint64_t first_seed{1};
  std::filesystem::path output;
  std::vector<std::string> only{};                        // Skills; all if there are none.
  Condition condition{Condition::kAsDocumented};          // How well the robots are built.
  std::vector<std::pair<std::string, double>> changes{};  // Beside it: values of `Variation`.

  // The command that repeats the evaluation `name`.
  [[nodiscard]] std::string command(const std::string& name) const;
};

// A row whose trials have been run.
struct JudgedRow {
  SkillRow row;
  std::vector<Report> reports;

  [[nodiscard]] int successes() const;
  [[nodiscard]] bool holds() const;
  // The least, the largest and the middle figure, in the unit of the table.
  [[nodiscard]] std::string spread() const;
  [[nodiscard]] double worst(std::string_view figure) const;
  [[nodiscard]] double least(std::string_view figure) const;
};

// Runs the trials of a row on all processors; those in real time one after the other.
[[nodiscard]] std::vector<Report> run_all(const Options& options, const SkillRow& row);

// Runs the trials of a row, and prints how many have succeeded and what is wrong with the others.
[[nodiscard]] JudgedRow judged(const Options& options, SkillRow row);

// Writes a page. Throws Error.
void write_page(const std::filesystem::path& path, const std::string& page);

// Reads the options of an evaluation from its words and runs it. Returns the exit status.
[[nodiscard]] int run_evaluation(const std::string& name, const std::string& what, Options options,
                                 const std::vector<std::string>& words,
                                 const std::function<int(const Options&)>& evaluate);

}  // namespace trifinger::evaluation
