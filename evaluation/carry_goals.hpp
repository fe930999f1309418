// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "evaluation/skill_trial.hpp"

// Starts and goals of the Real Robot Challenge for the skill `carry`.
namespace trifinger::evaluation {

// Puts the object anywhere on the table within 138.7 mm of the middle, on any face, turned by any
// angle.
void vary_start(SkillTrial& trial, TrialRandom& random);

// A place within 138.7 mm of the axis, as likely as any other, at height `z` [m].
[[nodiscard]] Eigen::Vector3d in_disc(TrialRandom& random, double z);

// A goal of difficulty 4: anywhere within 138.7 mm of the axis and 56.3 to 100 mm high, in any
// orientation.
[[nodiscard]] control::Pose draw_goal(TrialRandom& random);

// Writes the goal into the settings of a trial's skill, and reads it.
void set_goal(SkillTrial& trial, const control::Pose& goal);
[[nodiscard]] control::Pose goal_of(const SkillTrial& trial);

// A pose on the table from which a grasp carries the object to the goal; nothing if the goal is out
// of reach.
[[nodiscard]] std::optional<control::Pose> rest_for_goal(const SkillTrial& trial);

}  // namespace trifinger::evaluation
