// SPDX-License-Identifier: BSD-3-Clause
// `./run evaluate teach`: teaches skills in simulation, by springs that lead the tips, and writes
// the motions that `trifinger manipulate SKILL --taught` plays.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/regular_file.hpp"
#include "evaluation/teaching.hpp"
#include "trifinger/manipulation/skills.hpp"

namespace trifinger::evaluation {
namespace {

struct TeachOptions {
  std::vector<std::string> skills;
  std::filesystem::path output{"config/skills/taught"};
  std::optional<double> interval;  // [s]
  Hands hands;
};

// The time between two samples of a motion that is taught [s]: fast motions need more of them.
double usual_interval(std::string_view skill) {
  if (skill == "throw") return 0.005;
  return skill == "flip" ? 0.01 : 0.02;
}

void write(const std::filesystem::path& path, const std::string& text) {
  replace_file(path, std::as_bytes(std::span(text)));
}

int teach(const TeachOptions& options) {
  for (const manipulation::SkillInfo& skill : manipulation::all_skills()) {
    const std::string name(skill.name);
    if (std::ranges::find(options.skills, name) == options.skills.end()) continue;
    const SkillTrial trial = make_skill_trial(std::string(skill.robot), name);
    const control::Seconds interval(options.interval.value_or(usual_interval(name)));
    const auto motion = taught(trial, options.hands, interval);
    const auto path = options.output / (name + ".csv");
    write(path, text_of(motion));
    fmt::print("{}: {:.1f} s in {}\n", name, motion.duration().count(), path.string());
  }
  return 0;
}

int run_program(int argument_count, char** arguments) {
  TeachOptions options;
  CLI::App program("Teaches skills in simulation by springs that lead the tips.", "evaluate teach");
  program.add_option("SKILL", options.skills, "The skills to teach")->required();
  program.add_option("--output", options.output, "Folder of the motions")->capture_default_str();
  program
      .add_option(
          "--interval", options.interval,
          "Time between two samples [s]; default: 0.005 for throw, 0.01 for flip, else 0.02")
      ->check(CLI::Range(0.001, 0.1));
  program.add_option("--stiffness", options.hands.stiffness, "Of the springs [N/m]")
      ->capture_default_str();
  program.add_option("--damping", options.hands.damping, "Of the springs [Ns/m]")
      ->capture_default_str();
  CLI11_PARSE(program, argument_count, arguments);
  std::filesystem::create_directories(options.output);
  return teach(options);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  try {
    return trifinger::evaluation::run_program(argument_count, arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "evaluate teach: {}\n", error.what());
    return 1;
  }
}
