// SPDX-License-Identifier: BSD-3-Clause
// A short version of `./run evaluate control`.
#include "evaluation/trial.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <string>

namespace trifinger::evaluation {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::uint64_t kSeeds = 3;

void expect_within(const manipulation::Report& report, double position, double orientation) {
  EXPECT_TRUE(report.is_done) << text_of(report.failure);
  EXPECT_EQ(report.grasps, 1);
  EXPECT_LE(report.position_rms, position);
  EXPECT_LE(report.orientation_rms, orientation);
  EXPECT_LE(report.hold_drift, 1e-3);
}

TEST(Trial, LiftsTwentyCentimetres) {
  const Trial trial =
      make_trial("sim", {"fingers.height=0.3"}, "edu", "lift", {"lift.hold_time=3"});
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto report = run_trial(varied(trial, seed)).report;
    expect_within(report, 1.5e-3, 2.5 * kDegree);
    EXPECT_NEAR(report.height, 0.2, 3e-3);
  }
}

TEST(Trial, SlidesOnACircle) {
  const Trial trial = make_trial("sim", {}, "edu", "slide", {"slide.turns=1"});
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    expect_within(run_trial(varied(trial, seed)).report, 1.5e-3, 1.5 * kDegree);
  }
}

TEST(Trial, LiftsAndSlidesOverEmulatedMotorBoards) {
  const auto report = [](const Trial& trial) { return run_trial(varied(trial, 1)).report; };
  const std::string boards = "trifinger_edu_emulated";
  const Trial lift =
      make_trial(boards, {"fingers.height=0.3"}, "edu", "lift", {"lift.hold_time=3"});
  const auto lifted = report(lift);
  expect_within(lifted, 1.5e-3, 2.5 * kDegree);
  EXPECT_NEAR(lifted.height, 0.2, 3e-3);
  // Its seed decides all of it.
  EXPECT_EQ(report(lift).position_rms, lifted.position_rms);
  const Trial slide = make_trial(boards, {}, "edu", "slide", {"slide.turns=1"});
  expect_within(report(slide), 1.5e-3, 1.5 * kDegree);
}

TEST(Trial, HoldsAgainstAPush) {
  Trial trial = make_trial("sim", {"fingers.height=0.3"}, "edu", "lift", {"lift.hold_time=3"});
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto calm = run_trial(varied(trial, seed)).report;
    Trial pushed = varied(trial, seed);
    pushed.push = push_from_any_side(seed);
    pushed.push->after = control::Seconds(1);
    const auto report = run_trial(pushed).report;
    EXPECT_TRUE(report.is_done && report.grasps == 1) << text_of(report.failure);
    // The push had an effect.
    EXPECT_NE(report.position_rms, calm.position_rms);
  }
}

TEST(Trial, IsDecidedByItsSeed) {
  const Trial trial = make_trial("sim", {}, "edu", "lift");
  const Trial first = varied(trial, 5);
  const Trial again = varied(trial, 5);
  const Trial other = varied(trial, 6);
  EXPECT_EQ(first.simulation.description.objects[0].position,
            again.simulation.description.objects[0].position);
  EXPECT_NE(first.simulation.description.objects[0].position,
            other.simulation.description.objects[0].position);
  EXPECT_EQ(first.believed.objects[0].mass, trial.believed.objects[0].mass);
}

}  // namespace
}  // namespace trifinger::evaluation
