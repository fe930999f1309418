// SPDX-License-Identifier: BSD-3-Clause
// Counts the goals of difficulty 4 that are in reach of the skill `carry`, by their distance from
// the axis: count_reachable_goals [GOALS] [SETTING ...], with settings of the skill.
#include <fmt/core.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "evaluation/carry_goals.hpp"

namespace trifinger::evaluation {
namespace {

constexpr std::size_t kRings = 7;
constexpr double kRing = 0.02;  // [m]

struct Count {
  int reached{0};
  int all{0};
};

void count(int goals, const std::vector<std::string>& settings) {
  const SkillTrial trial = make_skill_trial("pushing", "carry", {}, settings);
  std::array<Count, kRings> rings;
  Count all;
  TrialRandom random(4);
  for (int i = 0; i < goals; ++i) {
    SkillTrial one = trial;
    const control::Pose goal = draw_goal(random);
    set_goal(one, goal);
    const bool is_reached = rest_for_goal(one).has_value();
    const auto ring = static_cast<std::size_t>(goal.position.head<2>().norm() / kRing);
    for (Count* each : {&all, &rings.at(ring)}) {
      ++each->all;
      each->reached += is_reached ? 1 : 0;
    }
  }
  for (std::size_t i = 0; i < rings.size(); ++i)
    fmt::print("{:3.0f} to {:3.0f} mm from the axis: {} of {}\n",
               1e3 * kRing * static_cast<double>(i), 1e3 * kRing * static_cast<double>(i + 1),
               rings.at(i).reached, rings.at(i).all);
  fmt::print("all: {} of {} in reach\n", all.reached, all.all);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  try {
    const std::vector<std::string> words(arguments + 1, arguments + argument_count);
    const int goals = words.empty() ? 100 : std::stoi(words.front());
    trifinger::evaluation::count(
        goals, words.empty() ? words : std::vector<std::string>(words.begin() + 1, words.end()));
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "count_reachable_goals: {}\n", error.what());
    return 1;
  }
}
