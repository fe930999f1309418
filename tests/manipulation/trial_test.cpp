// SPDX-License-Identifier: BSD-3-Clause
// A short version of `./run evaluate control`.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>

#include "evaluation/cube_trial.hpp"

namespace trifinger::evaluation {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::uint64_t kSeeds = 3;

double figure(const SkillTrialResult& result, std::string_view name) {
  const auto found = std::ranges::find(result.figures, name, &manipulation::Figure::name);
  return found == result.figures.end() ? std::numeric_limits<double>::quiet_NaN() : found->value;
}

void expect_within(const SkillTrialResult& result, double position, double orientation) {
  EXPECT_EQ(result.trace.failure, "");
  EXPECT_EQ(figure(result, "grasps"), 1);
  EXPECT_LE(figure(result, "position_rms"), position);
  EXPECT_LE(figure(result, "orientation_rms"), orientation);
  EXPECT_LE(figure(result, "hold_drift"), 1e-3);
}

TEST(Trial, LiftsTwentyCentimetres) {
  const SkillTrial trial =
      make_skill_trial("sim", "lift", {"fingers.height=0.3"}, {"lift.hold_time=3"});
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto report = run_skill_trial(varied(trial, seed));
    expect_within(report, 1.5e-3, 2.5 * kDegree);
    EXPECT_NEAR(figure(report, "height"), 0.2, 3e-3);
  }
}

TEST(Trial, SlidesOnACircle) {
  const SkillTrial trial = make_skill_trial("sim", "slide", {}, {"slide.turns=1"});
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    expect_within(run_skill_trial(varied(trial, seed)), 1.5e-3, 1.5 * kDegree);
  }
}

TEST(Trial, LiftsAndSlidesOverEmulatedMotorBoards) {
  const auto report = [](const SkillTrial& trial) { return run_skill_trial(varied(trial, 1)); };
  const std::string boards = "trifinger_edu_emulated";
  const SkillTrial lift =
      make_skill_trial(boards, "lift", {"fingers.height=0.3"}, {"lift.hold_time=3"});
  const auto lifted = report(lift);
  expect_within(lifted, 1.5e-3, 2.5 * kDegree);
  EXPECT_NEAR(figure(lifted, "height"), 0.2, 3e-3);
  // Its seed decides all of it.
  EXPECT_EQ(figure(report(lift), "position_rms"), figure(lifted, "position_rms"));
  const SkillTrial slide = make_skill_trial(boards, "slide", {}, {"slide.turns=1"});
  expect_within(report(slide), 1.5e-3, 1.5 * kDegree);
}

TEST(Trial, HoldsAgainstAPush) {
  SkillTrial trial = make_skill_trial("sim", "lift", {"fingers.height=0.3"}, {"lift.hold_time=3"});
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto calm = run_skill_trial(varied(trial, seed));
    SkillTrial pushed = varied(trial, seed);
    push_from_any_side(pushed, seed, 1.0, control::Seconds(1));
    const auto report = run_skill_trial(pushed);
    EXPECT_EQ(report.trace.failure, "");
    EXPECT_EQ(figure(report, "grasps"), 1);
    // The push had an effect.
    EXPECT_NE(figure(report, "position_rms"), figure(calm, "position_rms"));
  }
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
