// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "evaluation/skill_rows.hpp"
#include "skill_trials.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::SkillRow;
using evaluation::SkillTrial;

// The skills in which two tips pinch a box and the third one turns it.
class PinchedSkill : public ::testing::TestWithParam<const char*> {
 protected:
  [[nodiscard]] static SkillRow row() {
    return std::string_view(GetParam()) == "turn" ? evaluation::turn_rows().front()
                                                  : evaluation::stand_rows().front();
  }
  [[nodiscard]] static SkillTrial trial() { return row().trial; }
};

TEST_P(PinchedSkill, DoesWhatItShouldFromAStartThatVaries) { expect_success(row()); }

TEST_P(PinchedSkill, IsNotSaidToSucceedIfItDidNothing) {
  const SkillRow the_row = row();
  SkillTrial idle = the_row.trial;
  idle.simulation.object_loss = 1.0;
  const auto result = evaluation::run_skill_trial(idle);
  EXPECT_EQ(result.trace.failure, "the object was not seen");
  EXPECT_FALSE(the_row.judge(idle, result).succeeds);
}

TEST_P(PinchedSkill, PutsTheObjectDownWhenItIsStopped) {
  for (const std::string_view phase : {"look", "approach", "pinch", "lift", "reach", "turn",
                                       "withdraw", "lower", "loosen", "release", "check"}) {
    expect_put_down_when_stopped(trial(), phase, 100);
  }
}

TEST_P(PinchedSkill, EndsWithoutPosesInAnyPhase) {
  for (const std::string_view phase : {"look", "pinch", "turn", "release"}) {
    const SkillTrial the_trial = trial();
    const Simulation simulation(the_trial.simulation);
    MeddledSkill skill = skill_of(the_trial);
    bool is_blind = false;
    skill.lets_see = [&](TimeIndex) {
      is_blind = is_blind || skill.state().phase == phase;
      return !is_blind;
    };
    double fastest = 0.0;
    double before = gap(simulation);
    SkillRunOptions options;
    options.on_step = [&](TimeIndex) {
      const double now = gap(simulation);
      fastest = std::max(fastest, (before - now) / 1e-3);
      before = now;
    };
    EXPECT_FALSE(run(simulation, skill, options).failure.empty()) << phase;
    EXPECT_LT(gap(simulation), 2e-3) << phase;
    EXPECT_LT(fastest, 0.3) << "it fell in " << phase;
  }
}

TEST_P(PinchedSkill, SaysThatTheObjectIsGone) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  SkillRunOptions options;
  options.on_phase = [&](const Skill& at) {
    if (at.state().phase == "reach")
      simulation.robot().place_object(std::string(at.object()), {.position = {0.0, 0.2, 0.2}});
  };
  EXPECT_FALSE(run(simulation, skill, options).failure.empty());
}

TEST_P(PinchedSkill, BearsStepsThatAreLeftOut) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  skill.lets_step = [](TimeIndex step) { return step % 17 != 3 && step % 17 != 4; };
  EXPECT_EQ(run(simulation, skill).failure, "");
}

TEST_P(PinchedSkill, KeepsItsTipsOnTheBoxWhileItTurns) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  auto robot = simulation.connect();
  std::array<bool, 3> presses{};
  std::array<int, 3> losses{};
  int steps = 0;
  SkillRunOptions options;
  options.on_step = [&](TimeIndex t) {
    const bool turns = skill.state().phase == "turn";
    if (turns) ++steps;
    const auto& forces = robot.get_observation(t).tip_force;
    for (std::size_t tip = 0; tip < forces.size(); ++tip) {
      const bool did = std::exchange(presses[tip], forces[tip] > 0.0);
      if (turns && did && !presses[tip]) ++losses[tip];
    }
  };
  EXPECT_EQ(run_skill(robot, skill, options).failure, "");
  ASSERT_GT(steps, 0);
  constexpr double kMaxPerSecond = 2.0;
  for (std::size_t tip = 0; tip < losses.size(); ++tip)
    EXPECT_LE(losses[tip] * 1e3 / steps, kMaxPerSecond) << "tip " << tip;
}

TEST_P(PinchedSkill, AllocatesNothingInItsLoop) {
  const SkillTrial the_trial = trial();
  const Simulation simulation(the_trial.simulation);
  MeddledSkill skill = skill_of(the_trial);
  const SkillTrace trace = run(simulation, skill);
  EXPECT_EQ(trace.steps.back().phase, "done");
  EXPECT_EQ(skill.allocations(), 0U);
}

INSTANTIATE_TEST_SUITE_P(Skills, PinchedSkill, ::testing::Values("turn", "stand"),
                         [](const auto& instance) { return std::string(instance.param); });

}  // namespace
}  // namespace trifinger::manipulation
