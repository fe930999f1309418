// SPDX-License-Identifier: BSD-3-Clause
// Runs trials of a row of docs/results: run_trial ROW --seeds 700 701 [--condition "as built"]
// [--vary backlash=0.004] [--set line.force=0.3]. Prints a line of JSON for each. Without ROW,
// prints all rows.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string row;
  std::vector<std::uint64_t> seeds;
  std::string condition{name_of(Condition::kAsDocumented)};
  std::vector<std::string> changes;
  std::vector<std::string> settings;
  std::string robot;
  std::string known;
};

// "backlash=0.004". Throws InvalidArgument if it is anything else.
std::pair<std::string, double> change_of(std::string_view text) {
  const std::size_t equals = std::min(text.find('='), text.size());
  const std::string_view number = text.substr(std::min(equals + 1, text.size()));
  double value = 0.0;
  const auto [end, error] = std::from_chars(number.begin(), number.end(), value);
  if (error != std::errc() || end != number.end())
    throw InvalidArgument("write NAME=VALUE, such as backlash=0.004");
  Variation checked;
  set_value(checked, text.substr(0, equals), value);
  checked.validate();
  return {std::string(text.substr(0, equals)), value};
}

void print(const Json& json) {
  fmt::print("{}\n", json.dump());
  std::fflush(stdout);
}

void print_rows() {
  for (const Table& table : all_tables()) {
    for (const SkillRow& row : table.rows) {
      print({{"table", table.name},
             {"name", row.name},
             {"skill", row.trial.skill},
             {"what", row.what},
             {"reach", row.reach},
             {"needed", row.needed},
             {"most_trials", row.most_trials},
             {"figure", row.figure},
             {"unit", row.unit},
             {"scale", row.scale},
             {"like", row.like},
             {"is_real_time", row.trial.real_time.has_value()},
             {"is_on_boards", row.trial.boards.has_value()}});
    }
  }
}

// What came out, in SI units.
Json run(const SkillRow& row, SkillTrial trial, std::uint64_t seed) {
  Json json{{"seed", seed}};
  row.vary(trial, seed);
  try {
    const SkillTrialResult result = run_skill_trial(trial);
    const Judgement judgement = row.judge(trial, result);
    json["succeeds"] = judgement.succeeds;
    json["why"] = judgement.why;
    json["note"] = judgement.note;
    if (judgement.succeeds) json["figure"] = judgement.figure;
    json["strain"] = {{"contact_depth", result.strain.contact_depth},
                      {"torque_limit", result.strain.torque_limit},
                      {"speed", result.strain.speed},
                      {"thermal_margin", result.strain.thermal_margin}};
    json["figures"] = Json::object();
    for (const manipulation::Figure& figure : result.figures)
      json["figures"][figure.name] = {figure.value, figure.unit};
  } catch (const Error& error) {  // such as a fault of the robot
    json["succeeds"] = false;
    json["why"] = error.what();
  }
  return json;
}

int run(const Options& options) {
  const Condition condition = condition_from_name(options.condition);
  std::vector<std::pair<std::string, double>> changes;
  changes.reserve(options.changes.size());
  for (const std::string& change : options.changes) changes.push_back(change_of(change));
  for (const Table& table : all_tables()) {
    for (const SkillRow& row : table.rows) {
      if (row.name != options.row) continue;
      SkillTrial trial = row.trial;
      trial.condition = condition;
      trial.changes = changes;
      if (!options.robot.empty())
        trial.simulation.identified = load_robot_config(options.robot).simulation.identified;
      if (!options.known.empty())
        trial.known = load_robot_config(options.known).simulation.identified;
      trial.settings.insert(trial.settings.end(), options.settings.begin(), options.settings.end());
      for (const std::uint64_t seed : options.seeds) print(run(row, trial, seed));
      return 0;
    }
  }
  throw InvalidArgument("there is no row '" + options.row + "'");
}

int run_program(int argument_count, char** arguments) {
  Options options;
  CLI::App program("Runs trials of a skill.", "run_trial");
  program.add_option("ROW", options.row, "Name of the row; none: prints all rows");
  program.add_option("--seeds", options.seeds, "One trial each");
  program.add_option("--condition", options.condition, "'as documented', 'as built' or 'worn'")
      ->capture_default_str();
  program
      .add_option("--vary", options.changes,
                  "NAME=VALUE of trifinger.Variation, beside the condition; repeatable")
      ->allow_extra_args(false);
  program.add_option("--set", options.settings, "KEY=VALUE of the skill, to try it; repeatable")
      ->allow_extra_args(false);
  program.add_option("--robot", options.robot,
                     "Configuration whose section `identified` says how the joints are");
  program.add_option("--known", options.known, "And what the skill knows of that");
  CLI11_PARSE(program, argument_count, arguments);
  if (!options.row.empty()) return run(options);
  print_rows();
  return 0;
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  try {
    return trifinger::evaluation::run_program(argument_count, arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "run_trial: {}\n", error.what());
    return 1;
  }
}
