// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evaluation/skill_trial.hpp"

namespace trifinger::evaluation {

// The rows of each skill, in packages/trifinger_skills, beside the skill: SKILL/judge.cpp. A judge
// knows nothing of its skill but what it should do.
[[nodiscard]] std::vector<SkillRow> balance_rows();
[[nodiscard]] std::vector<SkillRow> carry_rows();
[[nodiscard]] std::vector<SkillRow> catch_rows();
[[nodiscard]] std::vector<SkillRow> draw_rows();
[[nodiscard]] std::vector<SkillRow> flip_rows();
[[nodiscard]] std::vector<SkillRow> lift_rows();
[[nodiscard]] std::vector<SkillRow> place_rows();
[[nodiscard]] std::vector<SkillRow> slide_rows();
[[nodiscard]] std::vector<SkillRow> stand_rows();
[[nodiscard]] std::vector<SkillRow> throw_rows();
[[nodiscard]] std::vector<SkillRow> turn_rows();

// The table of `./run evaluate skills`: all but those of lift and slide, which are in the table of
// `./run evaluate control`.
[[nodiscard]] std::vector<SkillRow> all_skill_rows();

}  // namespace trifinger::evaluation
