// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <atomic>
#include <string>
#include <string_view>

#include "evaluation/skill_rows.hpp"
#include "skill_trials.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::SkillRow;
using evaluation::SkillTrial;

SkillRow row() { return evaluation::draw_rows().front(); }

// A short word, so that a test does not take long.
SkillTrial trial() {
  return evaluation::make_skill_trial("sim_pen", "draw", {},
                                      {"word=L", "letter_height=0.015", "line.speed=0.03"});
}

// Whether the pen is nib down with its nib between the blocks, near the table.
bool stands_in_holder(const Simulation& simulation) {
  const auto& objects = simulation.robot().options().description.objects;
  const ObjectPose pose = simulation.robot().object_pose("pen");
  const auto& q = pose.orientation;
  const Eigen::Vector3d along =
      Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d nib =
      Eigen::Vector3d::Map(pose.position.data()) + objects.front().size[0] / 2 * along;
  Eigen::Vector3d holder = Eigen::Vector3d::Zero();
  for (std::size_t i = 1; i < objects.size(); ++i) {
    const ObjectPose block = simulation.robot().object_pose(objects[i].name);
    holder += Eigen::Vector3d::Map(block.position.data()) / static_cast<double>(objects.size() - 1);
  }
  return along.z() < -0.9 && (nib - holder).head<2>().norm() < 0.01 && nib.z() < 0.01;
}

TEST(Draw, WritesAWordFromStartsThatVary) {
  const SkillRow the_row = row();
  int successes = 0;
  std::string why;
  for (const std::uint64_t seed : {31U, 32U, 33U}) {
    SkillTrial varied = the_row.trial;
    the_row.vary(varied, seed);
    const auto judgement = the_row.judge(varied, evaluation::run_skill_trial(varied));
    successes += static_cast<int>(judgement.succeeds);
    why += judgement.why + "\n";
  }
  EXPECT_GE(successes, 2) << why;
}

TEST(Draw, IsNotSaidToSucceedIfItDidNothing) {
  SkillTrial idle = trial();
  idle.simulation.object_loss = 1.0;
  const auto result = evaluation::run_skill_trial(idle);
  EXPECT_EQ(result.trace.failure, "the pen was not seen");
  EXPECT_FALSE(row().judge(idle, result).succeeds);
}

TEST(StoppedDraw, PutsThePenBackWhenItIsStopped) {
  for (const std::string_view phase : {"look", "approach", "close", "grip", "lift", "carry", "hop",
                                       "land", "draw", "return", "lower", "release"}) {
    const SkillTrial the_trial = trial();
    const Simulation simulation(the_trial.simulation);
    MeddledSkill skill = skill_of(the_trial);
    std::atomic<bool> stop{false};
    TimeIndex in_phase = 0;
    SkillRunOptions options{.stop = &stop};
    options.on_step = [&](TimeIndex) {
      if (skill.state().phase == phase && ++in_phase == 50) stop = true;
    };
    const SkillTrace trace = run(simulation, skill, options);
    EXPECT_TRUE(stop) << phase;
    EXPECT_EQ(trace.failure, "it was stopped") << phase;
    EXPECT_TRUE(stands_in_holder(simulation)) << phase;
  }
}

TEST(StoppedDraw, EndsWithoutPosesInAnyPhase) {
  for (const std::string_view phase : {"look", "grip", "draw", "release"}) {
    const SkillTrial the_trial = trial();
    const Simulation simulation(the_trial.simulation);
    MeddledSkill skill = skill_of(the_trial);
    bool is_blind = false;
    skill.lets_see = [&](TimeIndex) {
      is_blind = is_blind || skill.state().phase == phase;
      return !is_blind;
    };
    const SkillTrace trace = run(simulation, skill);
    if (phase != "grip" && phase != "draw") {
      EXPECT_FALSE(trace.failure.empty()) << phase;
    }
    EXPECT_TRUE(stands_in_holder(simulation)) << phase;
  }
}

TEST(StoppedDraw, SaysThatThePenIsGone) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  SkillRunOptions options;
  options.on_phase = [&](const Skill& at) {
    if (at.state().phase == "hop")
      simulation.robot().place_object("pen", {.position = {0.0, 0.2, 0.2}});
  };
  EXPECT_EQ(run(simulation, skill, options).failure, "the pen slipped away");
}

TEST(Draw, BearsStepsThatAreLeftOut) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  skill.lets_step = [](TimeIndex step) { return step % 17 != 3 && step % 17 != 4; };
  EXPECT_EQ(run(simulation, skill).failure, "");
}

TEST(Draw, AllocatesNothingInItsLoop) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  const SkillTrace trace = run(simulation, skill);
  EXPECT_EQ(trace.steps.back().phase, "done");
  EXPECT_EQ(skill.allocations(), 0U);
}

}  // namespace
}  // namespace trifinger::manipulation
