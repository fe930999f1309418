// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>

#include "evaluation/landing.hpp"
#include "evaluation/skill_rows.hpp"
#include "evaluation/skill_trial.hpp"
#include "manipulation/skills/throw/stroke.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::landing;
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

Pose start_of(const SkillTrial& trial) {
  return {.position = Eigen::Vector3d::Map(trial.believed.objects.front().position.value().data())};
}

Stroke any_stroke() {
  Stroke stroke{.spacing = Seconds(0.025), .targets = {}, .stiffness = 15.0, .damping = 0.02};
  for (int i = 0; i < 5; ++i) {
    JointValues target(9);
    for (Eigen::Index k = 0; k < 9; ++k) target[k] = 0.1 * std::sin(static_cast<double>(7 * i + k));
    stroke.targets.push_back(target);
  }
  return stroke;
}

TEST(Stroke, MeetsItsTargetsAndRestsOutside) {
  const Stroke stroke = any_stroke();
  for (std::size_t i = 0; i < stroke.targets.size(); ++i) {
    const auto there = targets_at(stroke, static_cast<double>(i) * stroke.spacing);
    EXPECT_LT((there.position - stroke.targets[i]).norm(), 1e-12);
  }
  EXPECT_EQ(targets_at(stroke, Seconds(-1)).position, stroke.targets.front());
  EXPECT_EQ(targets_at(stroke, Seconds(-1)).velocity.norm(), 0.0);
  EXPECT_EQ(targets_at(stroke, Seconds(9)).position, stroke.targets.back());
  EXPECT_EQ(targets_at(stroke, Seconds(9)).velocity.norm(), 0.0);
}

TEST(Stroke, HasTheVelocityOfItsPosition) {
  const Stroke stroke = any_stroke();
  constexpr double kStep = 1e-4;
  for (double t = 0.0012; t < 0.1; t += 0.0031) {
    const JointValues change =
        targets_at(stroke, Seconds(t + kStep)).position - targets_at(stroke, Seconds(t)).position;
    // Not where a target lies between the two.
    if (std::floor((t + kStep) / 0.025) != std::floor(t / 0.025)) continue;
    EXPECT_LT((change / kStep - targets_at(stroke, Seconds(t)).velocity).norm(), 1e-9);
  }
}

// A joint that is where it should be, with the speed that it should have, feels only what it shall.
TEST(Stroke, MakesUpForAllDamping) {
  const Stroke stroke = any_stroke();
  const control::SafetyLimits limits = control::safety_limits({});
  const StrokeTargets targets = targets_at(stroke, Seconds(0.03));
  const JointValues torque = JointValues::Constant(9, 0.02);
  TriFinger::Action action;
  follow(stroke, targets, limits, torque, action);
  for (std::size_t i = 0; i < 9; ++i) {
    const double velocity = targets.velocity[static_cast<Eigen::Index>(i)];
    EXPECT_EQ(action.position[i], targets.position[static_cast<Eigen::Index>(i)]);
    EXPECT_NEAR(action.torque[i] - (action.position_kd[i] + limits.safety_kd[i]) * velocity, 0.02,
                1e-12);
  }
}

TEST(Stroke, RefusesWhatMakesNoSense) {
  const control::SafetyLimits limits = control::safety_limits({});
  const Stroke good = any_stroke();
  EXPECT_NO_THROW(validate(good, limits));
  Stroke bad = good;
  bad.spacing = Seconds(0);
  EXPECT_THROW(validate(bad, limits), InvalidArgument);
  bad = good;
  bad.targets.resize(1);
  EXPECT_THROW(validate(bad, limits), InvalidArgument);
  bad = good;
  bad.targets[2][4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(validate(bad, limits), InvalidArgument);
  bad.targets[2][4] = 1.61;
  EXPECT_THROW(validate(bad, limits), InvalidArgument);
}

// Whoever looks at the ball later sees it land at the same place.
TEST(Landing, IsTheSameAllAlongAFlight) {
  const Eigen::Vector3d start(0.1, -0.05, 0.6);
  const Eigen::Vector3d velocity(1.0, 2.0, 0.8);
  const Eigen::Vector3d g(0, 0, -9.81);
  const double expected = landing(start, velocity, 0.025);
  for (const double t : {0.05, 0.2, 0.5}) {
    EXPECT_NEAR(landing(start + t * velocity + 0.5 * t * t * g, velocity + t * g, 0.025), expected,
                1e-12);
  }
  // Where a thing that is let go lies is right below.
  EXPECT_NEAR(landing(start, Eigen::Vector3d::Zero(), 0.025), std::hypot(0.1, 0.05), 1e-12);
}

TEST(Throw, ThrowsFartherThanTheUsualRobotCanWithItsOwnStroke) {
  for (const evaluation::SkillRow& row : evaluation::throw_rows()) {
    if (row.name == "throw") continue;  // It throws twice, and a hand must put the ball back.
    const SkillTrialResult result = run_skill_trial(row.trial);
    const evaluation::Judgement judgement = row.judge(row.trial, result);
    EXPECT_TRUE(judgement.succeeds) << judgement.why;
    EXPECT_GT(judgement.figure, row.name == "throw-far" ? 2.5 : 0.9);
    // What the skill reports from poses is what the judge sees.
    const auto distance = std::ranges::find(result.figures, "distance", &Figure::name);
    ASSERT_NE(distance, result.figures.end());
    EXPECT_NEAR(distance->value, judgement.figure, 0.01);
  }
}

// All of these once left a hard limit after the throw.
TEST(Throw, LeavesNoLimitOfARobotAsBuilt) {
  const evaluation::SkillRow row = evaluation::throw_rows().back();
  ASSERT_EQ(row.name, "throw-far");
  for (const std::uint64_t seed : {0U, 8U, 14U, 16U, 31U}) {
    SkillTrial trial = row.trial;
    trial.condition = Condition::kAsBuilt;
    row.vary(trial, seed);
    EXPECT_EQ(run_skill_trial(trial).trace.failure, "") << "seed " << seed;
  }
}

// Weak motors throw less far. The first throw tells, and the second one lands as far.
TEST(Throw, AnnouncesWhereTheBallOfAWeakRobotLands) {
  const evaluation::SkillRow row = evaluation::throw_rows().front();
  SkillTrial trial = row.trial;
  row.vary(trial, 31);
  trial.changes = {{"motor_gain", 0.9}};
  const evaluation::SkillTrialResult result = run_skill_trial(trial);
  const auto announced = std::ranges::find(result.figures, "announced", &Figure::name);
  ASSERT_NE(announced, result.figures.end()) << result.trace.failure;
  EXPECT_LT(announced->value, 1.2);
  EXPECT_NEAR(row.judge(trial, result).figure, announced->value, 0.1);
}

TEST(Throw, RefusesAStrokeForLessDamping) {
  const SkillTrial trial = make_skill_trial("throw", "throw");
  EXPECT_THROW((void)make_skill("throw", context_of(trial), {}, {"stroke=far"}), InvalidArgument);
}

TEST(Throw, WaitsForABallThatIsPutOnTheTips) {
  SkillTrial trial = make_skill_trial("throw", "throw");
  ObjectDescription& ball = trial.simulation.description.objects.front();
  const Triple place = *ball.position;
  ball.position = {0.4, 0.4, 0.03};
  trial.interfere = [place](SimulatedRobot& robot, TimeIndex t, const SkillState& /*state*/) {
    if (t == 500) robot.place_object("ball", {.position = place, .orientation = {1, 0, 0, 0}});
  };
  EXPECT_EQ(run_skill_trial(trial).trace.failure, "");
}

TEST(Throw, FailsWithoutABall) {
  SkillTrial trial = make_skill_trial("throw", "throw", {}, {"wait_time=0.5"});
  trial.simulation.description.objects.front().position = {0.4, 0.4, 0.03};
  EXPECT_EQ(run_skill_trial(trial).trace.failure, "no ball lies on the fingers");
}

TEST(Throw, FailsIfTheBallIsTakenAwayBefore) {
  SkillTrial trial = make_skill_trial("throw", "throw");
  trial.interfere = [](SimulatedRobot& robot, TimeIndex t, const SkillState& /*state*/) {
    if (t == 60)
      robot.place_object("ball", {.position = {0.4, 0.4, 0.03}, .orientation = {1, 0, 0, 0}});
  };
  EXPECT_EQ(run_skill_trial(trial).trace.failure, "the ball has left the fingers");
}

TEST(Throw, EndsWithoutAnyPose) {
  const SkillTrial trial = make_skill_trial("throw", "throw");
  const auto skill = make_skill("throw", context_of(trial), {}, {"wait_time=0.5"});
  TimeIndex t = -1;
  while (!skill->state().has_ended && t < 2000) (void)skill->update(t++, resting_joints(trial));
  EXPECT_EQ(skill->state().failure, "nobody has said where the ball is");
}

TEST(Throw, EndsIfPosesStop) {
  const SkillTrial trial = make_skill_trial("throw", "throw");
  for (const TimeIndex last : {50, 700}) {
    const auto skill = make_skill("throw", context_of(trial));
    for (TimeIndex t = -1; t < 9000 && !skill->state().has_ended; ++t) {
      if (t % 10 == 0 && t < last) skill->see(t, start_of(trial));
      (void)skill->update(t, resting_joints(trial));
    }
    EXPECT_EQ(skill->state().phase, "failed");
  }
}

TEST(Throw, EndsInEachPhaseWhenStopped) {
  for (const std::string phase : {"approach", "wait", "centre", "throw", "watch"}) {
    SkillTrial trial = make_skill_trial("throw", "throw");
    if (phase == "approach") trial.simulation.initial_position->at(0) += 0.3;
    if (phase == "wait") trial.simulation.description.objects.front().position = {0.4, 0.4, 0.03};
    const Simulation simulation(trial.simulation);
    auto robot = simulation.connect();
    const auto skill = make_skill("throw", context_of(trial));
    std::atomic<bool> stop{false};
    std::set<std::string> phases;
    const SkillTrace trace =
        run_skill(robot, *skill, {.stop = &stop, .on_update = [&](const SkillStep& step) {
                                    phases.emplace(step.phase);
                                    if (step.phase == phase) stop = true;
                                  }});
    EXPECT_TRUE(phases.contains(phase)) << phase;
    EXPECT_EQ(trace.failure, "it was stopped") << phase;
  }
}

TEST(Throw, DoesNotAllocate) {
  const SkillTrial trial = make_skill_trial("throw", "throw");
  const auto skill = make_skill("throw", context_of(trial));
  const control::JointState joints = resting_joints(trial);
  const test::AllocationCounter allocations;
  for (TimeIndex t = -1; t < 2000; ++t) {
    if (t % 10 == 0) skill->see(t, start_of(trial));
    (void)skill->update(t, joints);
  }
  EXPECT_EQ(allocations.count(), 0U);
  EXPECT_TRUE(skill->state().has_ended);
}

}  // namespace
}  // namespace trifinger::manipulation
