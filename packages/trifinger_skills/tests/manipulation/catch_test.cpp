// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "evaluation/skill_rows.hpp"
#include "evaluation/skill_trial.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::make_skill_trial;
using evaluation::run_skill_trial;
using evaluation::SkillTrial;
using evaluation::SkillTrialResult;

SkillContext context_of(const SkillTrial& trial) {
  return {.description = trial.believed, .limits = safety_limits_of(trial.simulation)};
}

control::JointState resting_joints(const SkillTrial& trial) {
  return {.position = joint_values(*trial.simulation.initial_position),
          .velocity = JointValues::Zero(9),
          .torque = JointValues::Zero(9)};
}

double value_of(const std::vector<Figure>& figures, const std::string& name) {
  const auto found = std::ranges::find(figures, name, &Figure::name);
  return found == figures.end() ? std::nan("") : found->value;
}

TEST(Catch, CatchesABallThatFalls) {
  const SkillTrial trial = make_skill_trial("catch", "catch");
  const SkillTrialResult result = run_skill_trial(trial);
  EXPECT_EQ(result.trace.failure, "");
  EXPECT_EQ(result.truth.back().touches(), 3);
  EXPECT_LT(result.truth.back().twist.linear.norm(), 0.01);
  // It came down where it was let go, with the speed of its fall.
  const auto& start = *trial.simulation.description.objects.front().position;
  EXPECT_NEAR(value_of(result.figures, "offset"), std::hypot(start[0], start[1]), 1e-4);
  EXPECT_NEAR(value_of(result.figures, "speed"), std::sqrt(2 * 9.81 * 0.5), 0.02);
}

TEST(Catch, FollowsEachWayOfTheJudgedRows) {
  for (const evaluation::SkillRow& row : evaluation::catch_rows()) {
    SkillTrial trial = row.trial;
    row.vary(trial, 1);
    const evaluation::Judgement judgement = row.judge(trial, run_skill_trial(trial));
    EXPECT_TRUE(judgement.succeeds) << row.what << ": " << judgement.why;
  }
}

// The same fall seen from the next finger ends at the same place, seen from there.
TEST(Catch, DoesTheSameForEachFinger) {
  const double turn = -2 * std::numbers::pi / 3;
  const Eigen::Vector3d start(0.012, 0.004, 1.045);
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    SkillTrial trial = make_skill_trial("catch", "catch", {}, {"hold_time=0.5"});
    trial.after = control::Seconds(0);
    const Eigen::AngleAxisd turned(i * turn, Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d here = turned * start;
    trial.simulation.description.objects.front().position = {here.x(), here.y(), here.z()};
    const Eigen::Vector3d end =
        turned.inverse() * run_skill_trial(trial).truth.back().object.position;
    if (i == 0) first = end;
    EXPECT_LT((end - first).norm(), 1e-3);
  }
}

TEST(Catch, FailsIfTheBallIsTakenAway) {
  SkillTrial trial = make_skill_trial("catch", "catch");
  trial.interfere = [](SimulatedRobot& robot, TimeIndex t, const SkillState& /*state*/) {
    if (t == 900)
      robot.place_object("ball", {.position = {0.5, 0.5, 0.03}, .orientation = {1, 0, 0, 0}});
  };
  EXPECT_EQ(run_skill_trial(trial).trace.failure, "the ball fell out of the fingers");
}

TEST(Catch, FailsIfNoBallComesNear) {
  SkillTrial trial = make_skill_trial("catch", "catch", {}, {"wait_time=1"});
  trial.simulation.description.objects.front().position = {0.5, 0.5, 0.9};
  EXPECT_EQ(run_skill_trial(trial).trace.failure, "no ball came down to the fingers");
}

TEST(Catch, EndsWithoutAnyPose) {
  const SkillTrial trial = make_skill_trial("catch", "catch");
  const auto skill = make_skill("catch", context_of(trial), {}, {"wait_time=0.5"});
  TimeIndex t = -1;
  while (!skill->state().has_ended && t < 2000) (void)skill->update(t++, resting_joints(trial));
  EXPECT_EQ(skill->state().failure, "nobody has said where the ball is");
}

TEST(Catch, EndsIfPosesStop) {
  const SkillTrial trial = make_skill_trial("catch", "catch");
  const auto skill = make_skill("catch", context_of(trial), {}, {});
  for (TimeIndex t = -1; t < 5000 && !skill->state().has_ended; ++t) {
    const double fallen = 0.5 * 9.81 * 1e-6 * static_cast<double>(t * t);
    if (t % 10 == 0 && t < 250) skill->see(t, {.position = {0.0, 0.0, 1.045 - fallen}});
    (void)skill->update(t, resting_joints(trial));
  }
  EXPECT_EQ(skill->state().failure, "the ball went out of sight");
}

// The joints stand still, so the torques tell where the tips shall be and how they shall press.
TEST(Catch, StaysClosedWhenItBeginsToHoldAndWhenItFails) {
  const SkillTrial trial = make_skill_trial("catch", "catch");
  // A slow closing that is not done when the ball is there, too.
  for (const char* const closing : {"closing_time=0.064", "closing_time=0.4"}) {
    const auto skill = make_skill("catch", context_of(trial), {}, {closing});
    const control::JointState joints = resting_joints(trial);
    std::array<double, 9> before{};
    std::set<std::string> phases;
    for (TimeIndex t = -1; t < 5000 && !skill->state().has_ended; ++t) {
      const double fallen = 0.5 * 9.81 * 1e-6 * static_cast<double>(t * t);
      if (t % 10 == 0 && t < 250) skill->see(t, {.position = {0.0, 0.0, 1.045 - fallen}});
      const TriFinger::Action action = skill->update(t, joints);
      for (std::size_t i = 0; t >= 0 && i < before.size(); ++i)
        EXPECT_NEAR(action.torque[i], before[i], 0.15) << skill->state().phase << ' ' << t;
      std::ranges::copy(action.torque, before.begin());
      phases.emplace(skill->state().phase);
    }
    EXPECT_TRUE(phases.contains("hold") && phases.contains("failed"));
  }
}

TEST(Catch, EndsInEachPhaseWhenStopped) {
  for (const std::string phase : {"approach", "wait", "close", "hold"}) {
    SkillTrial trial = make_skill_trial("catch", "catch");
    if (phase == "approach") trial.simulation.initial_position->at(0) += 0.3;
    const Simulation simulation(trial.simulation);
    auto robot = simulation.connect();
    const auto skill = make_skill("catch", context_of(trial));
    std::atomic<bool> stop{false};
    std::set<std::string> phases;
    const SkillTrace trace =
        run_skill(robot, *skill, {.stop = &stop, .on_update = [&](const SkillStep& step) {
                                    phases.emplace(step.phase);
                                    if (step.phase == phase) stop = true;
                                  }});
    EXPECT_TRUE(phases.contains(phase));
    EXPECT_EQ(trace.failure, "it was stopped") << phase;
    EXPECT_LT(trace.steps.size(), 3500U);
  }
}

TEST(Catch, DoesNotAllocate) {
  const SkillTrial trial = make_skill_trial("catch", "catch");
  const auto skill = make_skill("catch", context_of(trial));
  const control::JointState joints = resting_joints(trial);
  bool has_held = false;
  const test::AllocationCounter allocations;
  for (TimeIndex t = -1; t < 1000; ++t) {
    const double fallen = 0.5 * 9.81 * 1e-6 * static_cast<double>(t * t);
    if (t % 10 == 0) skill->see(t, {.position = {0.0, 0.0, std::max(1.045 - fallen, 0.545)}});
    (void)skill->update(t, joints);
    has_held = has_held || skill->state().phase == "hold";
  }
  EXPECT_EQ(allocations.count(), 0U);
  EXPECT_TRUE(has_held);
}

TEST(Catch, RefusesARobotWhoseFingersPointDown) {
  SkillTrial trial = make_skill_trial("catch", "catch");
  trial.believed.flipped = false;
  EXPECT_THROW((void)make_skill("catch", context_of(trial)), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::manipulation
