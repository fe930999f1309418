// SPDX-License-Identifier: BSD-3-Clause
// A short version of `./run evaluate control`.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "evaluation/cube_trial.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

constexpr std::uint64_t kSeeds = 3;

// Runs the row's trial of this seed and expects that its judge is content.
Report expect_success(const SkillRow& row, std::uint64_t seed) {
  SCOPED_TRACE("seed " + std::to_string(seed));
  SkillTrial trial = row.trial;
  row.vary(trial, seed);
  const SkillTrialResult result = run_skill_trial(trial);
  const Report report{.judgement = row.judge(trial, result), .figures = result.figures};
  EXPECT_TRUE(report.judgement.succeeds) << report.judgement.why;
  return report;
}

// The first row of the skill, in less time, with another robot.
SkillRow shorter(SkillRow row, const std::string& robot = "sim") {
  const bool lifts = row.trial.skill == "lift";
  row.trial = make_skill_trial(
      robot, row.trial.skill,
      lifts ? std::vector<std::string>{"fingers.height=0.3"} : std::vector<std::string>{},
      {lifts ? "lift.hold_time=3" : "slide.turns=1"});
  return row;
}

TEST(Trial, LiftsTwentyCentimetres) {
  const SkillRow row = shorter(lift_rows().front());
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed)
    EXPECT_NEAR(expect_success(row, seed).at("height"), 0.2, 3e-3);
}

TEST(Trial, SlidesOnACircle) {
  const SkillRow row = shorter(slide_rows().front());
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) expect_success(row, seed);
}

TEST(Trial, LiftsAndSlidesOverEmulatedMotorBoards) {
  const std::string boards = "trifinger_edu_emulated";
  const SkillRow lift = shorter(lift_rows().front(), boards);
  const Report lifted = expect_success(lift, 1);
  EXPECT_NEAR(lifted.at("height"), 0.2, 3e-3);
  // Its seed decides all of it.
  EXPECT_EQ(expect_success(lift, 1).at("position_rms"), lifted.at("position_rms"));
  expect_success(shorter(slide_rows().front(), boards), 1);
}

TEST(Trial, HoldsAgainstAPush) {
  const SkillRow row = shorter(lift_rows().front());
  SkillRow pushed = shorter(cube_row("", "", 1.0, row.trial));
  pushed.vary = [](SkillTrial& trial, std::uint64_t seed) {
    trial = varied(trial, seed);
    push_from_any_side(trial, seed, 1.0, control::Seconds(1));
  };
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Report report = expect_success(pushed, seed);
    // The push had an effect.
    EXPECT_NE(report.at("position_rms"), expect_success(row, seed).at("position_rms"));
  }
}

TEST(Trial, IsGraspedOnceAndStaysWithinItsLimits) {
  const SkillRow row = cube_row("", "", 1.0, make_skill_trial("sim", "lift"),
                                {.position_rms = 1e-3, .hold_drift = 2e-3});
  SkillTrialResult result;
  result.figures = {
      {"grasps", 1, "", ""}, {"position_rms", 1e-3, "m", ""}, {"hold_drift", 2e-3, "m", ""}};
  const auto judgement = [&] { return row.judge(row.trial, result); };
  EXPECT_TRUE(judgement().succeeds);
  result.figures[1].value = 1.1e-3;
  EXPECT_EQ(judgement().why, "beyond the reach");
  result.figures[0].value = 2;
  EXPECT_EQ(judgement().why, "it was grasped again");
  result.trace.failure = "the object got lost";
  EXPECT_EQ(judgement().why, "the object got lost");
}

TEST(Trial, IsDecidedByItsSeed) {
  const SkillTrial trial = make_skill_trial("sim", "lift", {});
  const SkillTrial first = varied(trial, 5);
  const SkillTrial again = varied(trial, 5);
  const SkillTrial other = varied(trial, 6);
  EXPECT_EQ(first.simulation.description.objects[0].position,
            again.simulation.description.objects[0].position);
  EXPECT_NE(first.simulation.description.objects[0].position,
            other.simulation.description.objects[0].position);
  EXPECT_EQ(first.believed.objects[0].mass, trial.believed.objects[0].mass);
}

}  // namespace
}  // namespace trifinger::evaluation
