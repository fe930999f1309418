// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "evaluation/carry_goals.hpp"
#include "evaluation/lying_cube.hpp"
#include "evaluation/skill_rows.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kPlace = 0.01;  // [m]
constexpr double kAngle = 0.1;   // [rad]

// A pose on the table, as one of the skill's goals.
struct TrialGoal {
  double x;
  double y;
  std::size_t face;
  double turn;

  [[nodiscard]] std::string text() const {
    return fmt::format("{{place: [{:.6f}, {:.6f}], face: \"{}\", turn: {:.6f}}}", x, y,
                       kFaces.at(face), turn);
  }
};

std::vector<TrialGoal> goals_of(const SkillTrial& trial) {
  std::vector<TrialGoal> goals;
  const std::string text = setting(trial, "goals").value_or("");
  for (std::size_t at = text.find('{'); at != std::string::npos; at = text.find('{', at + 1)) {
    TrialGoal goal{};
    std::string face;
    // "{place: [0.01, -0.02], face: "+x", turn: 1.5}": what is no number and no face becomes space.
    std::string rest = text.substr(at, text.find('}', at) - at);
    for (const std::string_view word : {"{place: [", "face: \"", "turn:", "],", "\",", ","}) {
      const std::size_t begin = rest.find(word);
      if (begin != std::string::npos) rest.replace(begin, word.size(), word.size(), ' ');
    }
    std::istringstream words(rest);
    if (!(words >> goal.x >> goal.y >> face >> goal.turn))
      throw InvalidArgument("goals that no trial has written: " + text);
    goal.face = face_of(face);
    goals.push_back(goal);
  }
  return goals;
}

// Angle from the orientation of `goal`. Written anew, with matrices, so that it shares nothing with
// the skill: first the face goes up, about x or y, then the cube turns about the vertical.
double angle_from(const TrialGoal& goal, const Quaterniond& orientation) {
  Eigen::AngleAxisd up;
  switch (goal.face) {
    case 0:
      up = {-kPi / 2, Vector3d::UnitY()};
      break;
    case 1:
      up = {kPi / 2, Vector3d::UnitY()};
      break;
    case 2:
      up = {kPi / 2, Vector3d::UnitX()};
      break;
    case 3:
      up = {-kPi / 2, Vector3d::UnitX()};
      break;
    case 4:
      up = {0, Vector3d::UnitX()};
      break;
    default:
      up = {kPi, Vector3d::UnitX()};
  }
  const Eigen::Matrix3d wanted =
      (Eigen::AngleAxisd(goal.turn, Vector3d::UnitZ()) * up).toRotationMatrix();
  const Eigen::Matrix3d left = wanted.transpose() * orientation.toRotationMatrix();
  return std::acos(std::clamp((left.trace() - 1) / 2, -1.0, 1.0));
}

// The cube stands by itself at one goal after the other, and at the last one for the whole second
// after the end.
Judgement judge_place(const SkillTrial& trial, const SkillTrialResult& result, double longest) {
  Judgement judgement;
  judgement.figure = duration_of(result);
  const std::vector<TrialGoal> goals = goals_of(trial);
  const auto wrong_at = [&](const TrialGoal& goal, const TrueStep& step) -> std::string {
    const double height = trial.believed.objects.front().size[2] / 2;
    const double distance = (step.object.position - Vector3d(goal.x, goal.y, height)).norm();
    const double angle = angle_from(goal, step.object.orientation);
    if (distance > kPlace || angle > kAngle)
      return fmt::format("{:.1f} mm and {:.3f} rad from the goal", 1e3 * distance, angle);
    return std::string(wrong_with(step));
  };
  // Each goal counts once the cube has stood there for so long.
  constexpr int kStands = 250;
  std::size_t reached = 0;
  int stands = 0;
  for (const TrueStep& step : result.truth) {
    if (reached == goals.size()) break;
    stands = wrong_at(goals[reached], step).empty() ? stands + 1 : 0;
    if (stands < kStands) continue;
    stands = 0;
    ++reached;
  }
  if (!result.trace.failure.empty()) judgement.why = std::string(result.trace.failure) + "; ";
  if (reached < goals.size())
    judgement.why += fmt::format("{} of {} goals; ", reached, goals.size());
  judgement.why +=
      last_second(result, [&](const TrueStep& step) { return wrong_at(goals.back(), step); });
  if (judgement.why.empty() && judgement.figure > longest) judgement.why = "it took too long";
  judgement.succeeds = judgement.why.empty();
  const ObjectDescription& start = trial.simulation.description.objects.front();
  judgement.note = fmt::format("{:.0f} mm from the middle to",
                               1e3 * std::hypot((*start.position)[0], (*start.position)[1]));
  for (const TrialGoal& goal : goals)
    judgement.note += fmt::format(" {:.0f} mm,", 1e3 * std::hypot(goal.x, goal.y));
  judgement.note += fmt::format(" face {}", kFaces.at(goals.front().face));
  if (result.timing) {
    judgement.note +=
        fmt::format("; lateness {}; {} of {} steps late", describe(result.timing->lateness()),
                    result.timing->late_steps(), result.timing->steps());
  }
  return judgement;
}

void vary_goals(SkillTrial& trial, std::uint64_t seed, int count) {
  TrialRandom random(seed);
  vary_start(trial, random);
  vary_physics(trial, random);
  std::string goals;
  for (int i = 0; i < count; ++i) {
    const Vector3d place = in_disc(random, 0.0);
    const TrialGoal goal{.x = place.x(),
                         .y = place.y(),
                         .face = static_cast<std::size_t>(random.between(0, 6)),
                         .turn = random.between(-kPi, kPi)};
    goals += (i > 0 ? ", " : "") + goal.text();
  }
  trial.settings.push_back("goals=[" + goals + "]");
  trial.settings.push_back(fmt::format("plan.seed={}", seed));
}

}  // namespace

std::vector<SkillRow> place_rows() {
  constexpr double kOne = 60.0;
  constexpr double kTen = 180.0;
  std::vector<SkillRow> rows;
  rows.push_back(
      {.name = "place",
       .what = "place: a cube from anywhere to any pose on the table, both within 13.9 cm of the "
               "middle, within 60 s",
       .reach = "18 of 20; 10 mm, 0.1 rad",
       .needed = 0.9,
       .trial = make_skill_trial("pushing", "place", {}, {"max_duration=58"}),
       .vary = [](SkillTrial& trial, std::uint64_t seed) { vary_goals(trial, seed, 1); },
       .judge = [](const SkillTrial& trial,
                   const SkillTrialResult& result) { return judge_place(trial, result, kOne); },
       .figure = "time",
       .unit = "s"});
  rows.push_back(
      {.name = "place-ten",
       .what = "place: ten poses one after the other, within 180 s",
       .reach = "stated; 10 mm, 0.1 rad",
       .needed = 0.0,
       .trial = make_skill_trial("pushing", "place", {}, {"max_duration=178"}),
       .most_trials = 3,
       .vary = [](SkillTrial& trial, std::uint64_t seed) { vary_goals(trial, seed, 10); },
       .judge = [](const SkillTrial& trial,
                   const SkillTrialResult& result) { return judge_place(trial, result, kTen); },
       .figure = "time",
       .unit = "s"});
  rows.push_back(
      {.name = "place-real-time",
       .what = "place, in real time: likewise, within 60 s",
       .reach = "14 of 20; 10 mm, 0.1 rad",
       .needed = 0.7,
       .trial =
           in_real_time(make_skill_trial("pushing", "place", {}, {"max_duration=58"}), "pushing"),
       .vary = [](SkillTrial& trial, std::uint64_t seed) { vary_goals(trial, seed, 1); },
       .judge = [](const SkillTrial& trial,
                   const SkillTrialResult& result) { return judge_place(trial, result, kOne); },
       .figure = "time",
       .unit = "s"});
  return rows;
}

}  // namespace trifinger::evaluation
