// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <string_view>
#include <utility>

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
  const Simulation<TriFinger> simulation(trial.simulation);
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
  const Simulation<TriFinger> simulation(trial.simulation);
  MeddledSkill skill = skill_of(trial);
  const SkillTrace trace = run(simulation, skill);
  EXPECT_EQ(trace.steps.back().phase, "done");
  EXPECT_EQ(skill.allocations(), 0U);
}

}  // namespace
}  // namespace trifinger::manipulation
