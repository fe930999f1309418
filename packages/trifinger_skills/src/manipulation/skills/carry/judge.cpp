// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "evaluation/carry_goals.hpp"
#include "evaluation/contact.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Quaterniond;

constexpr double kPi = std::numbers::pi;
constexpr double kPlace = 0.01;            // [m]
constexpr double kAngle = 15 * kPi / 180;  // [rad]
constexpr double kLongest = 120.0;         // [s]
constexpr std::size_t kHeld = 1000;        // Steps: a second.

// Written anew, with matrices, so that it shares nothing with the skill.
double angle_between(const Quaterniond& one, const Quaterniond& other) {
  const Eigen::Matrix3d left = one.toRotationMatrix().transpose() * other.toRotationMatrix();
  return std::acos(std::clamp((left.trace() - 1) / 2, -1.0, 1.0));
}

// What became of the cube after step `from`, in words: it must not fall, and at the end it lies on
// the table or is held. Empty if all is well.
std::string_view end_of(const SkillTrial& trial, const SkillTrialResult& result, std::size_t from) {
  constexpr double kHigh = 0.003;     // Of its lowest point: it is in the air [m].
  constexpr std::size_t kLetGo = 20;  // Steps: it falls by 2 mm.
  const ObjectDescription& cube = trial.simulation.description.objects.front();
  std::size_t free = 0;
  for (std::size_t i = from; i < result.truth.size(); ++i) {
    const TrueStep& now = result.truth[i];
    const bool is_free = now.touches() < 2 && lowest_point(cube, now.object) > kHigh;
    free = is_free ? free + 1 : 0;
    if (free > kLetGo) return "it was dropped later";
  }
  return {};
}

// The cube is at the goal for a whole second, and at least two tips hold it all the time. After
// that it comes back or is held to the end.
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
    judgement.why = judgement.figure > kLongest ? "it took too long" : end_of(trial, result, i);
    if (judgement.why.empty()) judgement.why = result.trace.failure;
    judgement.succeeds = judgement.why.empty();
    return judgement;
  }
  if (!result.trace.failure.empty()) judgement.why = std::string(result.trace.failure) + "; ";
  judgement.why += nearest_words;
  return judgement;
}

// A goal in reach: one that is not is drawn again. Returns from where on the table it is reached.
control::Pose vary_goal(SkillTrial& trial, TrialRandom& random) {
  const std::vector<std::string> settings = trial.settings;
  for (;;) {
    trial.settings = settings;
    set_goal(trial, draw_goal(random));
    if (const auto rest = rest_for_goal(trial)) return *rest;
  }
}

// The cube lies anywhere; the goal may be one that the planner refuses.
void vary_all(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_start(trial, random);
  vary_physics(trial, random);
  set_goal(trial, draw_goal(random));
  trial.settings.push_back(fmt::format("plan.seed={}", seed));
}

// The cube lies anywhere.
void vary(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_start(trial, random);
  vary_physics(trial, random);
  (void)vary_goal(trial, random);
  trial.settings.push_back(fmt::format("plan.seed={}", seed));
}

// The cube lies nearly where a grasp reaches the goal: within 5 mm and 6 degrees.
void vary_near(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_physics(trial, random);
  const control::Pose rest = vary_goal(trial, random);
  constexpr double kShift = 0.005;
  constexpr double kTurn = 0.1;
  ObjectDescription& object = trial.simulation.description.objects.front();
  object.position = Triple{rest.position.x() + random.between(-kShift, kShift),
                           rest.position.y() + random.between(-kShift, kShift), rest.position.z()};
  const Quaterniond q =
      Eigen::AngleAxisd(random.between(-kTurn, kTurn), Eigen::Vector3d::UnitZ()) * rest.orientation;
  object.orientation = {q.w(), q.x(), q.y(), q.z()};
  trial.settings.push_back(fmt::format("plan.seed={}", seed));
}

}  // namespace

std::vector<SkillRow> carry_rows() {
  SkillRow from_anywhere{
      .name = "carry",
      .what = "carry: a cube from anywhere to any pose in reach in the air, within 120 s",
      .reach = "14 of 20; 10 mm, 15°",
      .needed = 0.7,
      .trial = make_skill_trial("pushing", "carry"),
      .vary = vary,
      .judge = judge,
      .figure = "time",
      .unit = "s"};
  SkillRow from_near = from_anywhere;
  from_near.name = "carry-near";
  from_near.what = "the same, from where a grasp reaches the goal";
  from_near.reach = "stated";
  from_near.needed = 0.0;
  from_near.vary = vary_near;
  SkillRow to_anywhere = from_near;
  to_anywhere.name = "carry-any";
  to_anywhere.what = "carry: to any pose of difficulty 4, those out of reach included";
  to_anywhere.vary = vary_all;
  return {std::move(from_anywhere), std::move(from_near), std::move(to_anywhere)};
}

}  // namespace trifinger::evaluation
