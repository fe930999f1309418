// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <string_view>
#include <utility>

#include "evaluation/carry_goals.hpp"
#include "evaluation/contact.hpp"
#include "evaluation/skill_rows.hpp"
#include "meddled_skill.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/simulation.hpp"

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

MeddledSkill skill_of(const SkillTrial& trial) {
  return MeddledSkill(make_skill(trial.skill,
                                 {.description = trial.believed,
                                  .limits = safety_limits_of(trial.simulation),
                                  .period = trial.simulation.period},
                                 {}, trial.settings));
}

SkillTrace run(const Simulation<TriFinger>& simulation, MeddledSkill& skill,
               const SkillRunOptions& options = {}) {
  auto robot = simulation.connect();
  return run_skill(robot, skill, options);
}

double gap(const Simulation<TriFinger>& simulation) {
  const ObjectDescription& object = simulation.robot().options().description.objects.front();
  const ObjectPose pose = simulation.robot().object_pose(object.name);
  const auto& q = pose.orientation;
  return evaluation::lowest_point(object,
                                  {.position = Eigen::Vector3d::Map(pose.position.data()),
                                   .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3])});
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
    const SkillTrial trial = near_goal();
    const Simulation<TriFinger> simulation(trial.simulation);
    MeddledSkill skill = skill_of(trial);
    std::atomic<bool> stop{false};
    TimeIndex in_phase = 0;
    double fastest = 0.0;
    double before = gap(simulation);
    SkillRunOptions options{.stop = &stop};
    options.on_step = [&](TimeIndex) {
      constexpr TimeIndex kSteps = 250;
      if (skill.state().phase == phase && ++in_phase == kSteps) stop = true;
      const double now = gap(simulation);
      fastest = std::max(fastest, (before - now) / 1e-3);
      before = now;
    };
    const SkillTrace trace = run(simulation, skill, options);
    EXPECT_TRUE(stop) << phase;
    EXPECT_EQ(trace.failure, "it was stopped") << phase;
    EXPECT_LT(gap(simulation), 2e-3) << phase;
    EXPECT_LT(fastest, 0.3) << "it fell in " << phase;
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
