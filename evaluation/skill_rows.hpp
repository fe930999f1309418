// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
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

// A page of docs/results and its rows.
struct Table {
  std::string name;
  std::vector<SkillRow> rows;
};
// `skills` has all skills but lift and slide. These are in `control`, on motor boards as well, and
// in `vision`, with a cube that only cameras see.
[[nodiscard]] std::vector<Table> all_tables();

}  // namespace trifinger::evaluation
