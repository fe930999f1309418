// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evaluation/resting.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  constexpr double kTilt = 3 * std::numbers::pi / 180;
  const ObjectDescription& object = trial.simulation.description.objects.front();
  const auto longest = std::ranges::max_element(object.size) - object.size.begin();
  const control::Pose& end = result.truth.back().object;
  const Eigen::Vector3d edge = end.orientation * Eigen::Vector3d::Unit(longest);
  Judgement judgement{
      .succeeds = false,
      .figure =
          (control::Seconds(trial.simulation.period) * static_cast<double>(result.end)).count(),
      .why = {}};
  if (!result.trace.failure.empty()) {
    judgement.why = result.trace.failure;
  } else if (std::abs(edge.z()) < std::cos(kTilt)) {
    judgement.why = "it does not stand";
  } else if (std::abs(end.position.z() - *std::ranges::max_element(object.size) / 2) > 1e-3) {
    judgement.why = "it does not stand on the table";
  } else {
    judgement.why = what_moves(trial, result);
    judgement.succeeds = judgement.why.empty();
  }
  return judgement;
}

}  // namespace

std::vector<SkillRow> stand_rows() {
  return {{.name = "stand",
           .what = "stand a flat cuboid up that lies on its side, and leave it standing",
           .reach = "19 of 20",
           .needed = 0.95,
           .trial = make_skill_trial("sim_cuboid", "stand"),
           .vary = vary_place_and_physics,
           .judge = judge,
           .figure = "time",
           .unit = "s"}};
}

}  // namespace trifinger::evaluation
