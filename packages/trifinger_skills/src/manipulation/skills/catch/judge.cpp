// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evaluation/skill_rows.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::evaluation {
namespace {

// Height of a ball of 50 mm on the closed tips [m], from which falls are measured.
constexpr double kCatchHeight = 0.545;

// Caught: the fingers hold the ball still for the skill's last second, and still have it when the
// robot has held its pose for another second.
Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  constexpr double kStill = 0.003;      // Of a ball that is held [m].
  constexpr double kStillThere = 0.01;  // After the grip of the skill has become stiff joints [m].
  Judgement judgement;
  const auto second =
      static_cast<std::size_t>(control::Seconds(1) / control::Seconds(trial.simulation.period));
  if (!result.trace.failure.empty() || result.end <= second) {
    judgement.why =
        result.trace.failure.empty() ? "it ended within a second" : result.trace.failure;
    return judgement;
  }
  const Eigen::Vector3d held = result.truth[result.end - 1].object.position;
  double motion = 0.0;
  int fewest = 3;
  for (std::size_t i = result.end - second; i < result.end; ++i) {
    motion = std::max(motion, (result.truth[i].object.position - held).norm());
    fewest = std::min(fewest, result.truth[i].touches());
  }
  const TrueStep& last = result.truth.back();
  judgement.figure = motion;
  if (fewest < 2) {
    judgement.why = "the tips do not touch the ball";
  } else if (motion > kStill) {
    judgement.why = "the ball moves";
  } else if (last.touches() < 2 || (last.object.position - held).norm() > kStillThere) {
    judgement.why = "the ball was lost after the skill had ended";
  } else {
    judgement.succeeds = true;
  }
  return judgement;
}

SkillTrial with_delay(SkillTrial trial, TrialRandom& random) {
  vary_physics(trial, random);
  return trial;
}

// Falls 0.5 m, from anywhere in a square of 30 mm about the axis.
void drop(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  trial = with_delay(trial, random);
  constexpr double kOffset = 0.015;
  ObjectDescription& ball = trial.simulation.description.objects.front();
  const double x = random.between(-kOffset, kOffset);
  const double y = random.between(-kOffset, kOffset);
  ball.position = {x, y, kCatchHeight + 0.5};
}

// Is thrown from 0.5 m beside the axis, from any side and from 0.1 to 0.4 m above the fingers. It
// flies for 0.35 to 0.5 s and comes down within 15 mm of the axis.
void toss(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  trial = with_delay(trial, random);
  constexpr double kDistance = 0.5;
  constexpr double kOffset = 0.015;
  const double azimuth = random.between(-std::numbers::pi, std::numbers::pi);
  const double height = random.between(0.1, 0.4);
  const double time = random.between(0.35, 0.5);
  const double offset = kOffset * std::sqrt(random.between(0, 1));
  const double side = random.between(-std::numbers::pi, std::numbers::pi);
  const Eigen::Vector3d start(kDistance * std::cos(azimuth), kDistance * std::sin(azimuth),
                              kCatchHeight + height);
  const Eigen::Vector3d end(offset * std::cos(side), offset * std::sin(side), kCatchHeight);
  const Eigen::Vector3d velocity = (end - start) / time - 0.5 * time * control::gravity();
  ObjectDescription& ball = trial.simulation.description.objects.front();
  ball.position = {start.x(), start.y(), start.z()};
  ball.velocity = {velocity.x(), velocity.y(), velocity.z()};
}

}  // namespace

std::vector<SkillRow> catch_rows() {
  const SkillTrial trial = make_skill_trial("catch", "catch");
  return {{.name = "catch",
           .what = "catch a ball dropped from 0.5 m, up to 15 mm off each way",
           .reach = "19 of 20",
           .needed = 0.95,
           .trial = trial,
           .vary = drop,
           .judge = judge,
           .figure = "motion of the held ball",
           .unit = "mm",
           .scale = 1e3},
          {.name = "catch-thrown",
           .what = "catch a ball thrown in an arc from 0.5 m away",
           .reach = "16 of 20",
           .needed = 0.8,
           .trial = trial,
           .vary = toss,
           .judge = judge,
           .figure = "motion of the held ball",
           .unit = "mm",
           .scale = 1e3}};
}

}  // namespace trifinger::evaluation
