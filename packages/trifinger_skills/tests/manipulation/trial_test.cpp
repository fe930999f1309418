// SPDX-License-Identifier: BSD-3-Clause
// A short version of `./run evaluate control`.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "evaluation/cube_trial.hpp"
#include "manipulation/parts/task.hpp"
#include "manipulation/skills/lift/lift.hpp"

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

const std::vector<std::string> kRaised{"fingers.height=0.3"};
const Limits kLimits{.position_rms = 1.5e-3, .orientation_rms = 2.5 * kDegree, .hold_drift = 1e-3};
const Lift kShort{.height = 0.2, .hold = control::Seconds(3)};

// A lift and a slide that take less time than those of the table.
SkillRow lift_of(const std::string& robot = "sim", const Limits& limits = kLimits) {
  return lift_row("", "", "", 1.0, make_skill_trial(robot, "lift", kRaised, {"lift.hold_time=3"}),
                  limits, kShort);
}
SkillRow slide_of(const std::string& robot = "sim", double turns = 1) {
  return slide_row("", "", "", 1.0, make_skill_trial(robot, "slide", {}, {"slide.turns=1"}),
                   kLimits, {.turns = turns});
}

TEST(Trial, LiftsTwentyCentimetres) {
  const SkillRow row = lift_of();
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed)
    EXPECT_NEAR(expect_success(row, seed).at("height"), 0.2, 3e-3);
}

TEST(Trial, SlidesOnACircle) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) expect_success(slide_of(), seed);
}

TEST(Trial, LiftsAndSlidesOverEmulatedMotorBoards) {
  const std::string boards = "trifinger_edu_emulated";
  const Report lifted = expect_success(lift_of(boards), 1);
  EXPECT_NEAR(lifted.at("height"), 0.2, 3e-3);
  // Its seed decides all of it.
  EXPECT_EQ(expect_success(lift_of(boards), 1).at("position_rms"), lifted.at("position_rms"));
  expect_success(slide_of(boards), 1);
}

TEST(Trial, HoldsAgainstAPush) {
  SkillRow pushed = lift_of("sim", {});
  pushed.judge = [](const SkillTrial& trial, const SkillTrialResult& result) {
    return judge_lift(trial, result, {.height = 0.2, .hold = control::Seconds(1.5)}, {});
  };
  pushed.vary = [](SkillTrial& trial, std::uint64_t seed) {
    trial = varied(trial, seed);
    push_from_any_side(trial, seed, 1.0, control::Seconds(1));
  };
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Report report = expect_success(pushed, seed);
    // The push had an effect.
    EXPECT_NE(report.at("position_rms"), expect_success(lift_of(), seed).at("position_rms"));
  }
}

// What became of a cube that was at these heights [m], for a step each.
Judgement judged(const std::vector<double>& heights, const Limits& limits = {}) {
  const SkillTrial trial = make_skill_trial("sim", "lift");
  SkillTrialResult result;
  result.figures = {{"position_rms", 1e-3, "m", ""}};
  for (const double height : heights) {
    result.truth.push_back({.step = static_cast<TimeIndex>(result.truth.size()),
                            .object = {.position = {0, 0, 0.0325 + height}},
                            .tip_distances = {0.1, 0.1, 0.1}});
  }
  result.end = result.truth.size();
  result.truth.resize(result.end + 1000, result.truth.back());
  return judge_lift(trial, result, {.height = 0.2, .hold = control::Seconds(1)}, limits);
}

// Up for half a second, there for `hold` steps, down in as much time.
std::vector<double> lift_for(int hold) {
  std::vector<double> heights;
  for (int i = 0; i <= 1500; ++i) heights.push_back(0.2 * i / 1500);
  heights.insert(heights.end(), static_cast<std::size_t>(hold), 0.2);
  for (int i = 1500; i >= 0; --i) heights.push_back(0.2 * i / 1500);
  return heights;
}

TEST(Trial, IsJudgedByWhatTheCubeDid) {
  EXPECT_TRUE(judged(lift_for(1000)).succeeds) << judged(lift_for(1000)).why;
  EXPECT_EQ(judged(lift_for(1000), {.position_rms = 0.9e-3}).why, "1.00 mm rms from its way");
  EXPECT_EQ(judged(lift_for(900)).why, "it was at its height for 0.96 s");

  std::vector<double> again = lift_for(1000);
  const std::vector<double> once = again;
  again.insert(again.end(), once.begin(), once.end());
  EXPECT_EQ(judged(again).why, "it was lifted again");

  std::vector<double> dropped = lift_for(1000);
  dropped.resize(2500);
  for (int t = 0; 4.905e-6 * t * t < 0.2; ++t) dropped.push_back(0.2 - 4.905e-6 * t * t);
  dropped.push_back(0.0);
  EXPECT_EQ(judged(dropped).why, "it was dropped");

  std::vector<double> drifting = lift_for(1000);
  for (std::size_t i = 1500; i < drifting.size(); ++i)
    drifting[i] += 3e-3 * (i < 2500 ? static_cast<double>(i - 1500) / 1000
                                    : static_cast<double>(4001 - i) / 1501);
  EXPECT_EQ(judged(drifting, {.hold_drift = 1e-3}).why.substr(0, 10), "it drifted");
  EXPECT_TRUE(judged(drifting, {.hold_drift = 3.5e-3}).succeeds);

  std::vector<double> held = lift_for(1000);
  held.resize(2600);
  EXPECT_EQ(judged(held).why, "it was not put down");
}

TEST(Trial, ASlideThatGoesRoundOnceIsNotTwo) {
  const SkillRow row = slide_of("sim", 2.0);
  SkillTrial trial = row.trial;
  row.vary(trial, 1);
  const std::string why = row.judge(trial, run_skill_trial(trial)).why;
  EXPECT_TRUE(why.starts_with("it went round 1.") || why.starts_with("it went round 0.9")) << why;
}

// config/skills/lift_pro.yml asks for no more than that robot reaches.
TEST(Trial, TheProLiftsAsHighAsItReaches) {
  const SkillTrial trial =
      make_skill_trial("trifinger_pro", "lift", {"objects=[{name: cube, type: cube}]"});
  const manipulation::ManipulationConfig config = manipulation::load_lift(
      {.description = trial.believed, .limits = manipulation::safety_limits_of(trial.simulation)});
  EXPECT_GE(manipulation::reachable_height(trial.believed, config),
            std::get<manipulation::LiftTask>(config.task).height);
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
