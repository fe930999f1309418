// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include "evaluation/carry_goals.hpp"
#include "evaluation/skill_rows.hpp"
#include "skill_trials.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::SkillTrial;

// A goal to which the cube is carried from where it lies.
SkillTrial near_goal() {
  SkillTrial trial = evaluation::carry_rows().front().trial;
  evaluation::set_goal(
      trial, {{0.01, -0.01, 0.08},
              Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 1, 0).normalized()))});
  return trial;
}

TEST(Carry, HoldsTheCubeAtItsGoalAndBringsItBack) {
  SkillTrial trial = near_goal();
  evaluation::TrialRandom random(5);
  evaluation::vary_physics(trial, random);
  const auto result = evaluation::run_skill_trial(trial);
  EXPECT_EQ(result.trace.failure, "");
  const auto judgement = evaluation::carry_rows().front().judge(trial, result);
  EXPECT_TRUE(judgement.succeeds) << judgement.why;
  const auto error = std::ranges::find(result.figures, "position_error", &Figure::name);
  ASSERT_NE(error, result.figures.end());
  EXPECT_LT(error->value, 0.01);
  EXPECT_LT(result.truth.back().object.position.z(), 0.034);
}

TEST(Carry, PutsTheCubeDownWhenItIsStopped) {
  for (const std::string_view phase : {"look", "grasp", "follow", "hold", "lower", "release"}) {
    expect_put_down_when_stopped(near_goal(), phase, 250);
  }
}

TEST(Carry, GraspsTheCubeAgainAfterSomebodyTookItAway) {
  const SkillTrial trial = near_goal();
  const Simulation simulation(trial.simulation);
  MeddledSkill skill = skill_of(trial);
  bool is_taken = false;
  SkillRunOptions options;
  options.on_phase = [&](const Skill& at) {
    if (at.state().phase == "hold" && !std::exchange(is_taken, true))
      simulation.robot().place_object("cube", {.position = {0.01, 0.02, 0.0325}});
  };
  const SkillTrace trace = run(simulation, skill, options);
  EXPECT_TRUE(is_taken);
  EXPECT_EQ(trace.failure, "");
}

// The centres of the tips in the cube's frame, at the begin of each time that it was carried.
std::vector<Eigen::Matrix3d> grasps_of(const evaluation::SkillTrialResult& result) {
  std::vector<Eigen::Matrix3d> grasps;
  std::string_view before;
  for (const SkillStep& step : result.trace.steps) {
    if (step.phase == "follow" && before != step.phase) {
      const evaluation::TrueStep& now = result.truth_at(step.step);
      Eigen::Matrix3d& tips = grasps.emplace_back();
      for (Eigen::Index i = 0; i < 3; ++i) {
        const Eigen::Vector3d& tip = now.tips[static_cast<std::size_t>(i)];
        tips.col(i) = now.object.orientation.conjugate() * (tip - now.object.position);
      }
    }
    before = step.phase;
  }
  return grasps;
}

TEST(Carry, NeverTriesTheSameGraspAgain) {
  SkillTrial trial = near_goal();
  // No attempt is good enough.
  trial.settings.emplace_back("hold.orientation_tolerance=1e-6");
  trial.settings.emplace_back("hold.time=1.5");
  trial.settings.emplace_back("attempts=4");
  const auto result = evaluation::run_skill_trial(trial);
  EXPECT_EQ(result.trace.failure, "the object was not held where it should have been");
  const std::vector<Eigen::Matrix3d> grasps = grasps_of(result);
  ASSERT_EQ(grasps.size(), 4U);
  for (std::size_t i = 0; i < grasps.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GT((grasps[i] - grasps[j]).colwise().norm().maxCoeff(), 5e-3) << i << " and " << j;
}

TEST(Carry, SaysThatNobodySeesTheCube) {
  SkillTrial trial = near_goal();
  trial.simulation.object_loss = 1.0;
  const auto result = evaluation::run_skill_trial(trial);
  // The first pose always arrives. With this one alone it may even get there, but cannot know it.
  EXPECT_EQ(result.trace.failure, "nobody has said where the object is");
}

TEST(Carry, SaysThatTheGoalIsOutOfReach) {
  SkillTrial trial = evaluation::carry_rows().front().trial;
  evaluation::set_goal(trial, {{0.0, 0.0, 0.4}, Eigen::Quaterniond::Identity()});
  EXPECT_EQ(evaluation::run_skill_trial(trial).trace.failure,
            "no grasp reaches the goal, from wherever the object lies");
}

TEST(Carry, AllocatesNothingInItsLoop) {
  const SkillTrial trial = near_goal();
  const Simulation simulation(trial.simulation);
  MeddledSkill skill = skill_of(trial);
  const SkillTrace trace = run(simulation, skill);
  EXPECT_EQ(trace.steps.back().phase, "done");
  EXPECT_EQ(skill.allocations(), 0U);
}

}  // namespace
}  // namespace trifinger::manipulation
