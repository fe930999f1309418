// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/skill_rows.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace trifinger::evaluation {

std::vector<SkillRow> all_skill_rows() {
  std::vector<SkillRow> rows;
  const auto add = [&rows](std::vector<SkillRow> more) {
    std::ranges::move(more, std::back_inserter(rows));
  };
  add(balance_rows());
  add(stand_rows());
  add(turn_rows());
  add(repose_rows());
  add(catch_rows());
  add(throw_rows());
  return rows;
}

}  // namespace trifinger::evaluation
