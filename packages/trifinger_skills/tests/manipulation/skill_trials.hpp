// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <string_view>

#include "evaluation/contact.hpp"
#include "evaluation/skill_rows.hpp"
#include "evaluation/skill_trial.hpp"
#include "meddled_skill.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/condition.hpp"
#include "trifinger/sim/simulation.hpp"

// Trials of the evaluation with somebody who meddles.
namespace trifinger::manipulation {

inline SkillContext context_of(const evaluation::SkillTrial& trial) {
  return {.description = trial.believed,
          .limits = safety_limits_of(trial.simulation),
          .period = trial.simulation.period};
}

inline MeddledSkill skill_of(const evaluation::SkillTrial& trial) {
  return MeddledSkill(make_skill(trial.skill, context_of(trial), {}, trial.settings));
}

// The skill does what it should, on a robot in any condition in which it can be expected to.
inline void expect_success(const evaluation::SkillRow& row) {
  for (const Condition condition : {Condition::kAsDocumented, Condition::kAsBuilt}) {
    evaluation::SkillTrial trial = row.trial;
    row.vary(trial, 31);
    trial.condition = condition;
    const auto judgement = row.judge(trial, evaluation::run_skill_trial(trial));
    EXPECT_TRUE(judgement.succeeds) << name_of(condition) << ": " << judgement.why;
  }
}

inline SkillTrace run(const Simulation& simulation, MeddledSkill& skill,
                      const SkillRunOptions& options = {}) {
  auto robot = simulation.connect();
  return run_skill(robot, skill, options);
}

// Height of the lowest point of the object above the table.
inline double gap(const Simulation& simulation) {
  const ObjectDescription& object = simulation.robot().options().description.objects.front();
  const ObjectPose pose = simulation.robot().object_pose(object.name);
  const auto& q = pose.orientation;
  return evaluation::lowest_point(object,
                                  {.position = Eigen::Vector3d::Map(pose.position.data()),
                                   .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3])});
}

// Stops the skill when it has been in `phase` for `steps`: the object comes down without falling.
inline void expect_put_down_when_stopped(const evaluation::SkillTrial& trial,
                                         std::string_view phase, TimeIndex steps) {
  const Simulation simulation(trial.simulation);
  MeddledSkill skill = skill_of(trial);
  std::atomic<bool> stop{false};
  TimeIndex in_phase = 0;
  double fastest = 0.0;
  double before = gap(simulation);
  SkillRunOptions options{.stop = &stop};
  options.on_step = [&](TimeIndex) {
    if (skill.state().phase == phase && ++in_phase == steps) stop = true;
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

}  // namespace trifinger::manipulation
