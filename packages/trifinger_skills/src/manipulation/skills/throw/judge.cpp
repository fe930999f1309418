// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "evaluation/landing.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

constexpr double kFreeDistance = 0.02;  // No tip is so near to a ball that has left [m].

// What a row asks of the ball's landing [m].
struct Asked {
  double distance;
  double away{std::numeric_limits<double>::infinity()};  // At most from there.
  bool must_announce{false};  // Not this distance counts, but what was said before the throw.
};

// Where the ball was put on the tips last, by a hand: from one step to the next it is elsewhere.
auto last_placing(const std::vector<TrueStep>& truth) {
  constexpr double kJump = 0.05;  // [m]
  auto last = truth.begin();
  for (auto step = truth.begin(); step != truth.end(); ++step)
    if (step != truth.begin() &&
        (step->object.position - std::prev(step)->object.position).norm() > kJump)
      last = step;
  return last;
}

// A hand puts the ball back on the tips whenever they wait for it.
auto put_back(const SkillTrial& trial) {
  const ObjectDescription& ball = trial.simulation.description.objects.front();
  const ObjectPose start{.position = ball.position.value(), .orientation = ball.orientation};
  return [=, name = ball.name](SimulatedRobot& robot, TimeIndex,
                               const manipulation::SkillState& state) {
    constexpr double kFar = 0.1;  // [m]
    const Eigen::Vector3d there = Eigen::Vector3d::Map(robot.object_pose(name).position.data());
    const Eigen::Vector3d wanted = Eigen::Vector3d::Map(start.position.data());
    if (state.phase == "wait" && (there - wanted).norm() > kFar) robot.place_object(name, start);
  };
}

// The figure is where the ball lands, from its motion when it is free of all tips for good and
// before it meets the table.
Judgement judge(const Asked& asked, const SkillTrial& trial, const SkillTrialResult& result) {
  Judgement judgement;
  if (!result.trace.failure.empty()) {
    judgement.why = result.trace.failure;
    return judgement;
  }
  const double radius = trial.believed.objects.front().size[0] / 2;
  const auto is_free = [](const TrueStep& step) {
    return std::ranges::min(step.tip_distances) > kFreeDistance;
  };
  // The last step at which a tip was near before the ball met the table.
  const auto first = last_placing(result.truth);
  const auto met = std::find_if(first, result.truth.end(), [&](const TrueStep& step) {
    return step.object.position.z() < radius + 0.005;
  });
  auto left = met;
  while (left != first && is_free(*std::prev(left))) --left;
  if (left == met) {
    judgement.why = "the ball never left the fingers";
    return judgement;
  }
  const auto lands = [&](double depth) {
    return landing(left->object.position, left->twist.linear, radius, depth);
  };
  judgement.figure = lands(kFloorDepth);
  judgement.note =
      fmt::format("{:.2f} m, {:.2f} m at the height of the table", judgement.figure, lands(0.0));
  const Report report{.judgement = {}, .figures = result.figures};
  const double announced = asked.must_announce ? report.at("announced") : asked.distance;
  if (asked.must_announce) judgement.note += fmt::format(", announced {:.2f} m", announced);
  if (announced <= 0.0 && asked.must_announce) {
    judgement.why = "it announced nothing";
  } else if (judgement.figure < announced - asked.away) {
    judgement.why = "too short";
  } else if (judgement.figure > announced + asked.away) {
    judgement.why = "too far";
  }
  judgement.succeeds = judgement.why.empty();
  return judgement;
}

// A hand puts the ball on the tips, up to 3 mm off and a little above them, turned in any way.
void vary(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_physics(trial, random);
  vary_place(trial, random, 0.003);
  ObjectDescription& ball = trial.simulation.description.objects.front();
  if (ball.position) (*ball.position)[2] += random.between(0.0, 0.003);
  trial.interfere = put_back(trial);
}

SkillRow row(std::string name, std::string what, std::string reach, double needed, SkillTrial trial,
             const Asked& asked) {
  return {.name = std::move(name),
          .what = std::move(what),
          .reach = std::move(reach),
          .needed = needed,
          .trial = std::move(trial),
          .vary = vary,
          .judge = [asked](const SkillTrial& thrown,
                           const SkillTrialResult& result) { return judge(asked, thrown, result); },
          .figure = "distance"};
}

}  // namespace

std::vector<SkillRow> throw_rows() {
  constexpr double kUsual = 1.3;
  return {row("throw",
              "throw a ball of 20 g where it was announced after two throws, at most 1.3 m; usual "
              "limits",
              "18 of 20 within 10 cm", 0.9, make_skill_trial("throw", "throw", {}, {"practice=2"}),
              {.distance = kUsual, .away = 0.1, .must_announce = true}),
          row("throw-once", "throw it 1.3 m without practice", "stated within 10 cm", 0.0,
              make_skill_trial("throw", "throw"), {.distance = kUsual, .away = 0.1}),
          row("throw-far", "throw a ball of 20 g with the limits of throw_far",
              "19 of 20 without a fault", 0.95,
              make_skill_trial("throw_far", "throw", {}, {"stroke=far"}), {.distance = 0.0})};
}

}  // namespace trifinger::evaluation
