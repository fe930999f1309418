// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "evaluation/carry_goals.hpp"
#include "evaluation/contact.hpp"
#include "evaluation/skill_rows.hpp"
#include "manipulation/skills/carry/carry_planner.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using evaluation::SkillTrial;
using evaluation::TrialRandom;
using evaluation::TrueStep;

constexpr double kPi = std::numbers::pi;

SkillTrial trial_to(const Pose& goal) {
  SkillTrial trial = evaluation::carry_rows().front().trial;
  evaluation::set_goal(trial, goal);
  return trial;
}

CarryPlanner planner_of(const SkillTrial& trial) {
  return load_carry_planner({.description = trial.believed,
                             .limits = safety_limits_of(trial.simulation),
                             .period = trial.simulation.period},
                            trial.settings);
}

Pose lying(double x, double y, double turn) {
  return {{x, y, 0.0325}, Quaterniond(AngleAxisd(turn, Vector3d::UnitZ()))};
}

TEST(GoalsOfACarry, AreThoseOfTheChallenge) {
  TrialRandom random(1);
  constexpr int kGoals = 4000;
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  double nearer = 0.0;
  for (int i = 0; i < kGoals; ++i) {
    const Pose goal = evaluation::draw_goal(random);
    ASSERT_LE(goal.position.head<2>().norm(), 0.138708);
    ASSERT_GE(goal.position.z(), 0.056292);
    ASSERT_LE(goal.position.z(), 0.1);
    ASSERT_NEAR(goal.orientation.norm(), 1.0, 1e-12);
    nearer += goal.position.head<2>().norm() < 0.138708 / 2 ? 1.0 / kGoals : 0.0;
    mean += goal.orientation.toRotationMatrix() / kGoals;
  }
  // A quarter of the disc; no direction is preferred.
  EXPECT_NEAR(nearer, 0.25, 0.03);
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 0.05);
}

TEST(GoalsOfACarry, ComeBackFromTheSettingsOfATrial) {
  TrialRandom random(2);
  for (int i = 0; i < 20; ++i) {
    const Pose goal = evaluation::draw_goal(random);
    const Pose read = evaluation::goal_of(trial_to(goal));
    EXPECT_LT((read.position - goal.position).norm(), 1e-8);
    EXPECT_LT(read.orientation.angularDistance(goal.orientation), 1e-7);
  }
}

TEST(CarryPlanner, TriesPosesOnTheTableFromWhichTheGoalIsTiltedLittle) {
  TrialRandom random(3);
  for (int i = 0; i < 10; ++i) {
    const Pose goal = evaluation::draw_goal(random);
    const std::vector<Rest> rests = planner_of(trial_to(goal)).rests(lying(0.01, 0.02, 0.5));
    ASSERT_FALSE(rests.empty());
    EXPECT_TRUE(std::ranges::is_sorted(rests, {}, &Rest::cost));
    for (const Rest& rest : rests) {
      const Eigen::Matrix3d rotation = rest.pose.orientation.toRotationMatrix();
      EXPECT_NEAR(rotation.row(2).cwiseAbs().maxCoeff(), 1.0, 1e-9);
      EXPECT_NEAR(rest.pose.position.z(), 0.0325, 1e-12);
      EXPECT_LE(rest.pose.position.head<2>().norm(), goal.position.head<2>().norm() + 1e-8);
      // The face that looks up on the table is not far from looking up at the goal.
      const Vector3d up = rest.pose.orientation.conjugate() * Vector3d::UnitZ();
      EXPECT_GE((goal.orientation * up).z(), std::cos(1.0) - 1e-9);
    }
  }
}

TEST(CarryPlanner, FindsAPoseFromWhichAGraspReachesTheGoal) {
  const Pose goal{{0.01, -0.02, 0.08},
                  Quaterniond(AngleAxisd(0.6, Vector3d(1, 2, 0).normalized()))};
  CarryPlanner planner = planner_of(trial_to(goal));
  // From upside down no grasp reaches it.
  const Pose below{{0.0, 0.0, 0.0325}, Quaterniond(0, 1, 0, 0)};
  EXPECT_FALSE(planner.plan(below));
  const auto rest = planner.find_rest(below);
  ASSERT_TRUE(rest);
  const auto plan = planner.plan(rest->pose);
  ASSERT_TRUE(plan);
  const Pose end = plan->trajectory.at(plan->trajectory.begin_of(Leg::kHold)).pose;
  EXPECT_LT((end.position - goal.position).norm(), 1e-9);
  EXPECT_LT(end.orientation.angularDistance(goal.orientation), 1e-6);
}

TEST(CarryPlanner, FindsNothingOutOfReach) {
  for (const Vector3d& place : {Vector3d(0.0, 0.0, 0.4), Vector3d(0.25, 0.0, 0.1)})
    EXPECT_FALSE(planner_of(trial_to({place, Quaterniond::Identity()})).find_rest(lying(0, 0, 0)));
}

TEST(CarryTask, NeverTouchesTheTableOnItsWayAndComesBack) {
  const ObjectDescription cube{.name = "cube", .size = {0.065, 0.065, 0.065}};
  const double radius = 0.0325 * std::numbers::sqrt3;
  TrialRandom random(4);
  for (int i = 0; i < 10; ++i) {
    const Pose start = lying(0.02, -0.01, random.between(-kPi, kPi));
    const CarryTask task{.goal = evaluation::draw_goal(random),
                         .speed = 0.1,
                         .turn_speed = 0.6,
                         .clearance = 0.004,
                         .hold_time = Seconds(3)};
    const ObjectTrajectory whole(task, Seconds(0), start, start, 0.0, radius);
    for (const double share : {0.1, 0.3, 0.5, 0.7, 2.0}) {
      ObjectTrajectory trajectory = whole;
      const Seconds given_up = share * trajectory.begin_of(Leg::kHold);
      if (share <= 1.0) trajectory.give_up(given_up);
      for (Seconds time(0); time < trajectory.duration(); time += Seconds(0.02))
        ASSERT_GT(evaluation::lowest_point(cube, trajectory.at(time).pose), -1e-5) << time.count();
      const Pose end = trajectory.at(trajectory.duration()).pose;
      EXPECT_LT((end.position - start.position).norm(), 1e-9);
      EXPECT_LT(end.orientation.angularDistance(start.orientation), 1e-6);
    }
  }
}

// What a judge sees of a cube that is somewhere for a number of steps.
evaluation::SkillTrialResult held_at(const Pose& pose, std::size_t steps, int tips) {
  evaluation::SkillTrialResult result;
  for (std::size_t i = 0; i < 3 * steps; ++i) {
    TrueStep step{.step = static_cast<TimeIndex>(i), .object = lying(0, 0, 0)};
    step.tip_distances.fill(0.1);
    if (i >= steps && i < 2 * steps) {
      step.object = pose;
      std::fill_n(step.tip_distances.begin(), tips, 0.0);
    }
    result.truth.push_back(step);
  }
  result.end = result.truth.size();
  return result;
}

TEST(JudgeOfACarry, WantsACubeThatIsHeldAtTheGoalForASecond) {
  const evaluation::SkillRow row = evaluation::carry_rows().front();
  const Pose goal{{0.03, 0.0, 0.08}, Quaterniond(AngleAxisd(2.0, Vector3d(1, 2, 3).normalized()))};
  const SkillTrial trial = trial_to(goal);
  const auto succeeds = [&](const Pose& pose, std::size_t steps, int tips) {
    return row.judge(trial, held_at(pose, steps, tips)).succeeds;
  };
  const auto off = [&](const Vector3d& shift, double angle) {
    return Pose{goal.position + shift,
                AngleAxisd(angle, Vector3d(2, -1, 1).normalized()) * goal.orientation};
  };
  EXPECT_TRUE(succeeds(goal, 1000, 3));
  EXPECT_TRUE(succeeds(goal, 1000, 2));
  EXPECT_FALSE(succeeds(goal, 999, 3));
  EXPECT_FALSE(succeeds(goal, 1000, 1)) << "it was thrown there";
  const double degree = kPi / 180;
  EXPECT_TRUE(succeeds(off({0, 0.0099, 0}, 14.9 * degree), 1000, 3));
  EXPECT_FALSE(succeeds(off({0, 0.0101, 0}, 0), 1000, 3));
  EXPECT_FALSE(succeeds(off({0, 0, 0}, 15.1 * degree), 1000, 3));
}

TEST(JudgeOfACarry, DoesNotTakeTwoHalvesOfASecondForOne) {
  const evaluation::SkillRow row = evaluation::carry_rows().front();
  const Pose goal{{0.03, 0.0, 0.08}, Quaterniond::Identity()};
  const SkillTrial trial = trial_to(goal);
  auto result = held_at(goal, 1000, 3);
  EXPECT_TRUE(row.judge(trial, result).succeeds);
  result.truth[1500].object.position.x() += 0.02;
  EXPECT_FALSE(row.judge(trial, result).succeeds);
}

}  // namespace
}  // namespace trifinger::manipulation
