// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <string>
#include <string_view>

#include "evaluation/skill_rows.hpp"
#include "manipulation/skills/balance/tilt_observer.hpp"
#include "skill_trials.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::SkillRow;
using evaluation::SkillTrial;

SkillTrial short_trial() {
  SkillTrial trial = evaluation::balance_rows().front().trial;
  trial.settings.emplace_back("duration=1");
  return trial;
}

double tilt_of(const Simulation& simulation) {
  const auto& q = simulation.robot().object_pose("cuboid").orientation;
  return std::acos((Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * Eigen::Vector3d::UnitY()).z());
}

TEST(Balance, KeepsTheCuboidUprightFromAStartThatVaries) {
  expect_success(evaluation::balance_rows().front());
}

TEST(Balance, FallsAsItsEquationsSayIfNobodyBalancesIt) {
  const SkillTrial trial = short_trial();
  const Simulation simulation(trial.simulation);
  const TippingBox box{.half_height = 0.04,
                       .gyration = std::sqrt((0.08 * 0.08 + 0.02 * 0.02) / 12),
                       .tip_radius = figures(trial.believed).tip_radius};
  // From rest with its middle on the tip, so that s is -r a, the lever of the weight is h a.
  const double first = tilt_of(simulation);
  const double rate = std::sqrt(box.fall());
  const double s = -box.tip_radius * first;
  const double balance = s / (box.half_height - box.tip_radius);
  auto robot = simulation.connect();
  const auto hold = hold_position(robot.latest_observation());
  for (int i = 0; i < 200; ++i) (void)robot.get_observation(robot.append_desired_action(hold));
  const double expected = balance + (first - balance) * std::cosh(rate * 0.2);
  EXPECT_NEAR(tilt_of(simulation) / expected, 1.0, 0.15);
}

TEST(Balance, SaysThatTheObjectWasNotSeen) {
  const SkillTrial trial = short_trial();
  MeddledSkill skill = skill_of(trial);
  skill.lets_see = [](TimeIndex) { return false; };
  EXPECT_EQ(run(Simulation(trial.simulation), skill).failure, "the object was not seen");
}

TEST(Balance, SaysThatTheObjectIsOutOfSight) {
  const SkillTrial trial = short_trial();
  MeddledSkill skill = skill_of(trial);
  skill.lets_see = [](TimeIndex captured) { return captured < 500; };
  const std::string_view failure = run(Simulation(trial.simulation), skill).failure;
  EXPECT_TRUE(failure == "the object was out of sight" || failure == "the tip went too far")
      << failure;
}

TEST(Balance, SaysThatTheObjectFell) {
  const SkillTrial trial = short_trial();
  const Simulation simulation(trial.simulation);
  MeddledSkill skill = skill_of(trial);
  SkillRunOptions options;
  options.on_step = [&](TimeIndex t) {
    constexpr TimeIndex kBegin = 300;
    constexpr TimeIndex kEnd = 400;
    if (t == kBegin) simulation.robot().push_object("cuboid", {0.3, 0.0, 0.0});
    if (t == kEnd) simulation.robot().push_object("cuboid", {0.0, 0.0, 0.0});
  };
  const std::string_view failure = run(simulation, skill, options).failure;
  EXPECT_TRUE(failure == "the object fell" || failure == "the tip went too far") << failure;
}

TEST(Balance, SaysThatTheObjectStandsOnNoTip) {
  SkillTrial trial = short_trial();
  trial.simulation.description.objects.front().position = {0.0, 0.0, 0.7};
  MeddledSkill skill = skill_of(trial);
  EXPECT_EQ(run(Simulation(trial.simulation), skill).failure, "the object does not stand on a tip");
}

TEST(Balance, EndsAtOnceWhenItIsStopped) {
  const SkillTrial trial = short_trial();
  MeddledSkill skill = skill_of(trial);
  const std::atomic<bool> stop{true};
  const SkillTrace trace = run(Simulation(trial.simulation), skill, {.stop = &stop});
  EXPECT_EQ(trace.failure, "it was stopped");
  EXPECT_EQ(trace.steps.size(), 1U);
}

TEST(Balance, BearsStepsThatAreLeftOut) {
  const SkillTrial trial = short_trial();
  MeddledSkill skill = skill_of(trial);
  skill.lets_step = [](TimeIndex step) { return step % 10 != 3; };
  EXPECT_EQ(run(Simulation(trial.simulation), skill).failure, "");
}

TEST(Balance, AllocatesNothingInItsLoop) {
  const SkillTrial trial = short_trial();
  MeddledSkill skill = skill_of(trial);
  EXPECT_EQ(run(Simulation(trial.simulation), skill).failure, "");
  EXPECT_EQ(skill.allocations(), 0U);
}

}  // namespace
}  // namespace trifinger::manipulation
