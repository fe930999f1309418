// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "evaluation/carry_goals.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Quaterniond;

constexpr double kPi = std::numbers::pi;
constexpr double kPlace = 0.01;            // [m]
constexpr double kAngle = 15 * kPi / 180;  // [rad]
constexpr double kLongest = 120.0;         // [s]
constexpr std::size_t kHeld = 1000;        // Steps: a second.

// Written anew, with matrices, so that it shares nothing with
// the skill.
double angle_between(const Quaterniond& one, const Quaterniond& other) {
  const Eigen::Matrix3d left = one.toRotationMatrix().transpose() * other.toRotationMatrix();
  return std::acos(std::clamp((left.trace() - 1) / 2, -1.0, 1.0));
}

// The cube is at the goal for a whole second, and at least two tips hold it all the time.
Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  const control::Pose goal = goal_of(trial);
  Judgement judgement{
      .succeeds = false, .figure = 1e-3 * static_cast<double>(result.end), .why = {}};
  std::size_t held = 0;
  double nearest = std::numeric_limits<double>::infinity();
  std::string nearest_words = "it was never held";
  for (std::size_t i = 0; i < result.end; ++i) {
    const TrueStep& now = result.truth[i];
    const double distance = (now.object.position - goal.position).norm();
    const double angle = angle_between(goal.orientation, now.object.orientation);
    const bool is_held = now.touches() >= 2;
    const double worst = std::max(distance / kPlace, angle / kAngle);
    if (is_held && worst < nearest) {
      nearest = worst;
      nearest_words = fmt::format("at best {:.1f} mm and {:.1f} degrees from the goal",
                                  1e3 * distance, angle * 180 / kPi);
    }
    held = is_held && worst <= 1 ? held + 1 : 0;
    if (held < kHeld) continue;
    judgement.figure = 1e-3 * static_cast<double>(i + 1);
    judgement.succeeds = judgement.figure <= kLongest;
    if (!judgement.succeeds) judgement.why = "it took too long";
    return judgement;
  }
  if (!result.trace.failure.empty()) judgement.why = std::string(result.trace.failure) + "; ";
  judgement.why += nearest_words;
  return judgement;
}

// Goals that are out of reach are drawn again, `only_in_reach`.
void vary(SkillTrial& trial, std::uint64_t seed, bool only_in_reach) {
  TrialRandom random(seed);
  vary_start(trial, random);
  vary_physics(trial, random);
  const std::vector<std::string> settings = trial.settings;
  do {
    trial.settings = settings;
    set_goal(trial, draw_goal(random));
  } while (only_in_reach && !is_in_reach(trial));
  trial.settings.push_back(fmt::format("plan.seed={}", seed));
}

}  // namespace

std::vector<SkillRow> carry_rows() {
  const SkillRow in_reach{
      .what = "carry: a cube from anywhere to any pose in reach in the air, within 120 s",
      .reach = "15 of 20; 10 mm, 15°",
      .needed = 0.75,
      .trial = make_skill_trial("pushing", "carry"),
      .vary = [](SkillTrial& trial, std::uint64_t seed) { vary(trial, seed, true); },
      .judge = judge,
      .figure = "time",
      .unit = "s"};
  return {in_reach};
}

}  // namespace trifinger::evaluation
