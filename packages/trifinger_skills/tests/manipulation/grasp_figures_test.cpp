// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/grasp_figures.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

namespace trifinger::manipulation {
namespace {

constexpr TimeIndex kSecond = 1000;

// Makes a trace with 1 s of each phase. The object should stay at one place.
SkillTrace trace_of(const std::vector<std::pair<std::string_view, TimeIndex>>& phases) {
  SkillTrace trace;
  TimeIndex t = 0;
  for (const auto& [phase, length] : phases) {
    for (TimeIndex i = 0; i < length; ++i) {
      SkillStep step;
      step.step = t++;
      step.phase = phase;
      FeltGrasp& grasp = step.grasp.emplace();
      grasp.normal_forces.setConstant(2.0);
      grasp.tangential_forces.setConstant(0.5);
      grasp.is_exact = true;
      step.torque_share = 0.75;
      step.cycle_time = Seconds(1e-5);
      trace.steps.push_back(step);
    }
  }
  return trace;
}

std::vector<SeenPose> poses_at(const SkillTrace& trace, const Pose& pose) {
  std::vector<SeenPose> poses;
  poses.reserve(trace.steps.size());
  for (const SkillStep& step : trace.steps) poses.push_back({step.step, pose});
  return poses;
}

// NaN if there is no such figure.
double figure(const std::vector<Figure>& figures, std::string_view name) {
  const auto found = std::ranges::find(figures, name, &Figure::name);
  return found == figures.end() ? std::numeric_limits<double>::quiet_NaN() : found->value;
}

const std::vector<std::pair<std::string_view, TimeIndex>> kLift{
    {"look", 300},         {"grasp", kSecond}, {"follow", kSecond},
    {"hold", 4 * kSecond}, {"lower", kSecond}, {"release", kSecond}};

TEST(GraspFigures, OfAConstantErrorIsThatError) {
  const SkillTrace trace = trace_of(kLift);
  const Pose off{
      .position = {0.0, 3e-3, 4e-3},
      .orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()))};
  const auto figures = grasp_figures(trace, poses_at(trace, off));
  EXPECT_EQ(figure(figures, "num_poses"), 6 * kSecond);
  EXPECT_NEAR(figure(figures, "position_rms"), 5e-3, 1e-12);
  EXPECT_NEAR(figure(figures, "position_max"), 5e-3, 1e-12);
  EXPECT_NEAR(figure(figures, "orientation_rms"), 0.1, 1e-12);
  EXPECT_NEAR(figure(figures, "orientation_max"), 0.1, 1e-12);
  EXPECT_NEAR(figure(figures, "hold_drift"), 0.0, 1e-12);
  EXPECT_NEAR(figure(figures, "friction_used"), 0.25, 1e-12);
  EXPECT_NEAR(figure(figures, "torque_margin"), 0.25, 1e-12);
  EXPECT_EQ(figure(figures, "exact_wrenches"), 1.0);
  EXPECT_NEAR(figure(figures, "cycle_p999"), 1e-5, 1e-12);
}

TEST(GraspFigures, IgnoresWhatWasBeforeAndAfterTheTask) {
  const SkillTrace trace = trace_of(kLift);
  std::vector<SeenPose> poses = poses_at(trace, {});
  for (SeenPose& seen : poses) {
    const std::string_view phase = trace.steps[static_cast<std::size_t>(seen.step)].phase;
    if (phase == "grasp" || phase == "release") seen.pose.position.x() = 1.0;
  }
  EXPECT_EQ(figure(grasp_figures(trace, poses), "position_max"), 0.0);
}

TEST(GraspFigures, MeasuresDriftBetweenTheEndsOfHolding) {
  const SkillTrace trace = trace_of(kLift);
  std::vector<SeenPose> poses = poses_at(trace, {});
  // The speed is 1 mm/s. The means of the first and the last of four seconds are three seconds
  // apart.
  for (SeenPose& seen : poses) seen.pose.position.z() = 1e-6 * static_cast<double>(seen.step);
  EXPECT_NEAR(figure(grasp_figures(trace, poses), "hold_drift"), 3e-3, 1e-9);
}

TEST(GraspFigures, TakesTheLastGrasp) {
  auto phases = kLift;
  phases.insert(phases.begin(), {{"grasp", kSecond}, {"follow", kSecond}});
  const SkillTrace trace = trace_of(phases);
  std::vector<SeenPose> poses = poses_at(trace, {});
  for (SeenPose& seen : poses) seen.pose.position.x() = seen.step < 2 * kSecond ? 1.0 : 0.0;
  EXPECT_EQ(figure(grasp_figures(trace, poses), "position_max"), 0.0);
}

TEST(GraspFigures, OfNothingAreNone) {
  EXPECT_EQ(figure(grasp_figures({}, {}), "num_poses"), 0.0);
  EXPECT_TRUE(std::isnan(figure(grasp_figures({}, {}), "position_rms")));
  EXPECT_EQ(figure(grasp_figures(trace_of({{"follow", 10}, {"hold", 10}}), {}), "hold_drift"), 0.0);
}

}  // namespace
}  // namespace trifinger::manipulation
