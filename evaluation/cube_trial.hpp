// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evaluation/skill_trial.hpp"

// Trials of the skills lift and slide.
namespace trifinger::evaluation {

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

}  // namespace trifinger::evaluation
