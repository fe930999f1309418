// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <numbers>
#include <string>

#include "evaluation/skill_trial.hpp"

// Trials of the skills lift and slide, and their judges.
namespace trifinger::evaluation {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr double kMillimetre = 1e-3;

// Returns `trial` with everything varied that is not known in advance: what
// `vary_place_and_physics` varies. A robot with cameras has these instead of poses: with other
// light, colours, dust, noise, and a calibration that is 0.5 pixels off.
[[nodiscard]] SkillTrial varied(const SkillTrial& trial, std::uint64_t seed);

// Pushes the cube for 50 ms while it is held, so long `after` that has begun, with a `force` [N]
// from a side that depends on the seed.
void push_from_any_side(SkillTrial& trial, std::uint64_t seed, double force = 1.0,
                        control::Seconds after = control::Seconds(5.0));

// What a lift does, and a slide.
struct Lift {
  double height{0.2};         // Above where the cube lay [m].
  control::Seconds hold{15};  // There.
};
struct Slide {
  double radius{0.05};  // Of the circle [m].
  double turns{3};
};

// What the true poses of a trial must stay within: of the way that the skill wanted from the grasp
// to the release, and of the hold.
struct Limits {
  double position_rms{std::numeric_limits<double>::infinity()};     // [m]
  double orientation_rms{std::numeric_limits<double>::infinity()};  // [rad]
  double hold_drift{std::numeric_limits<double>::infinity()};       // [m]
};

// Judged by what the cube did: it was held at its height for that time in one go, was not dropped
// or lifted again, and lies still at the end, with no tip on it.
[[nodiscard]] Judgement judge_lift(const SkillTrial& trial, const SkillTrialResult& result,
                                   const Lift& lift, const Limits& limits);
// It went along a circle of this radius, on the table, and lies still at the end.
[[nodiscard]] Judgement judge_slide(const SkillTrial& trial, const SkillTrialResult& result,
                                    const Slide& slide, const Limits& limits);

// Rows of these trials, as `varied` makes them.
[[nodiscard]] SkillRow lift_row(std::string name, std::string what, std::string reach,
                                double needed, SkillTrial trial, const Limits& limits = {},
                                const Lift& lift = {});
[[nodiscard]] SkillRow slide_row(std::string name, std::string what, std::string reach,
                                 double needed, SkillTrial trial, const Limits& limits = {},
                                 const Slide& slide = {});

}  // namespace trifinger::evaluation
