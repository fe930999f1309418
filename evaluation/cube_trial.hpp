// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>

#include "evaluation/rows.hpp"

// Trials of the skills lift and slide, and their tables.
namespace trifinger::evaluation {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr double kMillimetre = 1e-3;

// Returns `trial` with everything varied that is not known in advance: where the cube lies (within
// 3 cm, any yaw), its mass (within 20 %), the friction of the tips (0.6 to 1.0), the delay of its
// poses (10 to 30 ms) and their noise (1 mm, 0.5 degrees). A robot with cameras has these instead
// of poses: with other light, colours, dust, noise, and a calibration that is 0.5 pixels off.
// Nobody watches when the skill has ended.
[[nodiscard]] SkillTrial varied(const SkillTrial& trial, std::uint64_t seed);

// Pushes the cube for 50 ms while it is held, so long `after` that has begun, with a `force` [N]
// from a side that depends on the seed.
void push_from_any_side(SkillTrial& trial, std::uint64_t seed, double force = 1.0,
                        control::Seconds after = control::Seconds(5.0));

// What the true poses of a trial must stay within, between the grasp and the release.
struct Limits {
  double position_rms{std::numeric_limits<double>::infinity()};     // [m]
  double orientation_rms{std::numeric_limits<double>::infinity()};  // [rad]
  double hold_drift{std::numeric_limits<double>::infinity()};       // [m]
};

// The trial as `varied` makes it. The first grasp must hold until the end, within the limits.
[[nodiscard]] SkillRow cube_row(std::string what, std::string reach, double needed,
                                SkillTrial trial, const Limits& limits = {});

// A row of the tables of these skills, the header of their columns, and the table of its trials, in
// Markdown.
[[nodiscard]] std::string_view cube_columns();
[[nodiscard]] std::string line_of(const JudgedRow& done);
[[nodiscard]] std::string details_of(const JudgedRow& done, std::uint64_t first_seed);

}  // namespace trifinger::evaluation
