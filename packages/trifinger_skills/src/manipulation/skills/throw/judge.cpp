// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <vector>

#include "evaluation/landing.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

constexpr double kFreeDistance = 0.02;  // No tip is so near to a ball that has left [m].

// The figure is where the ball lands, from its motion when it is free of all tips for good and
// before it meets the table.
Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
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
  const auto met = std::ranges::find_if(result.truth, [&](const TrueStep& step) {
    return step.object.position.z() < radius + 0.005;
  });
  auto left = met;
  while (left != result.truth.begin() && is_free(*std::prev(left))) --left;
  if (left == met) {
    judgement.why = "the ball never left the fingers";
    return judgement;
  }
  judgement.figure = landing(left->object.position, left->twist.linear, radius);
  judgement.succeeds = true;
  return judgement;
}

// The table's row asks for the median, and for the worst throw.
auto at_least(double distance) {
  return [distance](std::span<const Report> reports) {
    std::vector<double> figures;
    for (const Report& report : reports) figures.push_back(report.judgement.figure);
    std::ranges::sort(figures);
    const double median = figures[figures.size() / 2];
    return median >= distance && figures.front() >= 0.8 * median;
  };
}

// A hand puts the ball on the tips, up to 3 mm off and a little above them, turned in any way.
void vary(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_physics(trial, random);
  vary_place(trial, random, 0.003);
  ObjectDescription& ball = trial.simulation.description.objects.front();
  if (ball.position) (*ball.position)[2] += random.between(0.0, 0.003);
}

}  // namespace

std::vector<SkillRow> throw_rows() {
  return {{.what = "throw a ball of 20 g, usual limits",
           .reach = "1.3 m, worst 80 % of the median",
           .trial = make_skill_trial("throw", "throw"),
           .vary = vary,
           .judge = judge,
           .figure = "distance",
           .together = at_least(1.3)},
          {.what = "throw a ball of 20 g, limits of throw_far",
           .reach = "2.5 m, worst 80 % of the median",
           .trial = make_skill_trial("throw_far", "throw", {}, {"stroke=far"}),
           .vary = vary,
           .judge = judge,
           .figure = "distance",
           .together = at_least(2.5)}};
}

}  // namespace trifinger::evaluation
