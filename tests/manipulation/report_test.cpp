// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/report.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

namespace trifinger::manipulation {
namespace {

constexpr TimeIndex kSecond = 1000;

// Makes a trace with 1 s of each phase. The object should stay at one place.
Trace trace_of(const std::vector<std::pair<Phase, TimeIndex>>& phases) {
  Trace trace;
  trace.end = Phase::kDone;
  trace.grasps = 1;
  TimeIndex t = 0;
  for (const auto& [phase, length] : phases) {
    for (TimeIndex i = 0; i < length; ++i) {
      TraceStep step;
      step.step = t++;
      step.phase = phase;
      step.normal_forces.setConstant(2.0);
      step.tangential_forces.setConstant(0.5);
      step.torque_share = 0.75;
      step.status = control::ForceStatus::kExact;
      step.cycle_time = Seconds(1e-5);
      trace.steps.push_back(step);
    }
  }
  return trace;
}

std::vector<SeenPose> poses_at(const Trace& trace, const Pose& pose) {
  std::vector<SeenPose> poses;
  poses.reserve(trace.steps.size());
  for (const TraceStep& step : trace.steps) poses.push_back({step.step, pose});
  return poses;
}

const std::vector<std::pair<Phase, TimeIndex>> kLift{
    {Phase::kLook, 300},         {Phase::kGrasp, kSecond}, {Phase::kFollow, kSecond},
    {Phase::kHold, 4 * kSecond}, {Phase::kLower, kSecond}, {Phase::kRelease, kSecond}};

TEST(Report, OfAConstantErrorIsThatError) {
  const Trace trace = trace_of(kLift);
  const Pose off{
      .position = {0.0, 3e-3, 4e-3},
      .orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()))};
  const Report report = make_report(trace, poses_at(trace, off));
  EXPECT_TRUE(report.is_done);
  EXPECT_EQ(report.num_poses, static_cast<std::size_t>(6 * kSecond));
  EXPECT_NEAR(report.position_rms, 5e-3, 1e-12);
  EXPECT_NEAR(report.position_max, 5e-3, 1e-12);
  EXPECT_NEAR(report.orientation_rms, 0.1, 1e-12);
  EXPECT_NEAR(report.orientation_max, 0.1, 1e-12);
  EXPECT_NEAR(report.hold_drift, 0.0, 1e-12);
  EXPECT_NEAR(report.friction_used, 0.25, 1e-12);
  EXPECT_NEAR(report.torque_margin, 0.25, 1e-12);
  EXPECT_EQ(report.exact_wrenches, 1.0);
  EXPECT_NEAR(report.cycle_p999, 1e-5, 1e-12);
}

TEST(Report, IgnoresWhatWasBeforeAndAfterTheTask) {
  const Trace trace = trace_of(kLift);
  std::vector<SeenPose> poses = poses_at(trace, {});
  for (SeenPose& seen : poses) {
    const Phase phase = trace.steps[static_cast<std::size_t>(seen.step)].phase;
    if (phase == Phase::kGrasp || phase == Phase::kRelease) seen.pose.position.x() = 1.0;
  }
  EXPECT_EQ(make_report(trace, poses).position_max, 0.0);
}

TEST(Report, MeasuresDriftBetweenTheEndsOfHolding) {
  const Trace trace = trace_of(kLift);
  std::vector<SeenPose> poses = poses_at(trace, {});
  // The speed is 1 mm/s. The means of the first and the last of four seconds are three seconds
  // apart.
  for (SeenPose& seen : poses) seen.pose.position.z() = 1e-6 * static_cast<double>(seen.step);
  EXPECT_NEAR(make_report(trace, poses).hold_drift, 3e-3, 1e-9);
}

TEST(Report, TakesTheLastGrasp) {
  auto phases = kLift;
  phases.insert(phases.begin(), {{Phase::kGrasp, kSecond}, {Phase::kFollow, kSecond}});
  const Trace trace = trace_of(phases);
  std::vector<SeenPose> poses = poses_at(trace, {});
  for (SeenPose& seen : poses) seen.pose.position.x() = seen.step < 2 * kSecond ? 1.0 : 0.0;
  EXPECT_EQ(make_report(trace, poses).position_max, 0.0);
}

TEST(Report, OfNothingIsEmpty) {
  const Report report = make_report({}, {});
  EXPECT_FALSE(report.is_done);
  EXPECT_EQ(report.num_poses, 0U);
  EXPECT_EQ(make_report(trace_of({{Phase::kFollow, 10}, {Phase::kHold, 10}}), {}).hold_drift, 0.0);
}

}  // namespace
}  // namespace trifinger::manipulation
