// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>

#include "evaluation/skill_rows.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::evaluation {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// Puts the cuboid on the tip of finger 0 as a hand would: 1 to 5 degrees off the vertical, its
// middle up to 2 mm off the tip's, turned by any angle.
void put_on_tip(SkillTrial& trial, TrialRandom& random) {
  SimulationOptions& simulation = trial.simulation;
  const Kinematics kinematics(simulation.description);
  const Eigen::Vector3d tip =
      kinematics.tip_positions(joint_values(simulation.initial_position.value())).head<3>();
  const double radius = figures(simulation.description).tip_radius;
  ObjectDescription& box = simulation.description.objects.front();
  const double tilt = random.between(1.0, 5.0) * kDegree;
  const double direction = random.between(-std::numbers::pi, std::numbers::pi);
  const double yaw = random.between(-std::numbers::pi, std::numbers::pi);
  const Eigen::Vector3d axis(-std::sin(direction), std::cos(direction), 0.0);
  // The edge along y becomes upright.
  const Eigen::Quaterniond upright(
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX()));
  const Eigen::Quaterniond orientation = Eigen::AngleAxisd(tilt, axis) * upright;
  constexpr double kOffset = 0.002;
  const Eigen::Vector3d offset(random.between(-kOffset, kOffset), 0.0,
                               random.between(-kOffset, kOffset));
  const Eigen::Vector3d centre =
      tip + orientation * (offset + (radius + box.size[1] / 2) * Eigen::Vector3d::UnitY());
  box.position = {centre.x(), centre.y(), centre.z()};
  box.orientation = {orientation.w(), orientation.x(), orientation.y(), orientation.z()};
}

// Upright on one tip all the time, from the first step to the skill's end.
Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  constexpr double kLargestTilt = 20 * kDegree;
  constexpr double kTime = 10.0;  // [s]
  const control::Seconds period = trial.simulation.period;
  Judgement judgement{.succeeds = false, .figure = 0.0, .why = {}};
  for (std::size_t i = 0; i < result.end; ++i) {
    const TrueStep& now = result.truth[i];
    const double tilt = std::acos((now.object.orientation * Eigen::Vector3d::UnitY()).z());
    judgement.figure = period.count() * static_cast<double>(i + 1);
    if (!(tilt < kLargestTilt)) {
      judgement.why = "it fell";
    } else if (now.is_touched_by(1) || now.is_touched_by(2)) {
      judgement.why = "another finger touched it";
    }
    if (!judgement.why.empty()) return judgement;
  }
  if (!result.trace.failure.empty()) {
    judgement.why = result.trace.failure;
  } else if (judgement.figure < kTime) {
    judgement.why = "it ended too early";
  } else if (!result.truth[result.end - 1].is_touched_by(0)) {
    judgement.why = "it was not on the tip at the end";
  } else {
    judgement.succeeds = true;
  }
  return judgement;
}

SkillRow row(std::string name, std::string what, std::string reach, double needed,
             TimeIndex delay) {
  SkillTrial trial = make_skill_trial("sim_balance", "balance");
  trial.after = control::Seconds(0);
  return {.name = std::move(name),
          .what = std::move(what),
          .reach = std::move(reach),
          .needed = needed,
          .trial = std::move(trial),
          .vary =
              [delay](SkillTrial& varied, std::uint64_t seed) {
                TrialRandom random(seed);
                put_on_tip(varied, random);
                vary_physics(varied, random);
                varied.simulation.object_delay = delay;
              },
          .judge = judge,
          .figure = "time upright",
          .unit = "s"};
}

}  // namespace

std::vector<SkillRow> balance_rows() {
  constexpr TimeIndex kDelay = 10;
  constexpr TimeIndex kLongDelay = 20;
  return {row("balance", "balance a cuboid upright on one fingertip, poses 10 ms late",
              "18 of 20, for 10 s", 0.9, kDelay),
          row("balance-late", "the same, poses 20 ms late", "stated", 0.0, kLongDelay)};
}

}  // namespace trifinger::evaluation
