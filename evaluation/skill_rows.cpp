// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/skill_rows.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <string_view>

namespace trifinger::evaluation {
namespace {

// The same row, played as it was taught, with or without what varies. Nobody asks for a rate: what
// comes out is reported.
SkillRow taught(SkillRow row, bool varies) {
  row.what = (varies ? "taught, varied: " : "taught, as it was taught: ") + row.what;
  row.reach = "stated";
  row.needed = 0.0;
  row.together = {};
  row.trial.is_taught = true;
  if (!varies) {
    row.vary = [](SkillTrial& trial, std::uint64_t seed) {
      trial.simulation.seed = seed;
      // The face that looks up in the motion.
      if (trial.skill == "flip") trial.settings.emplace_back("face=+x");
    };
  }
  return row;
}

// The skills whose motions are in config/skills/taught.
constexpr std::array<std::string_view, 5> kTaught{"draw", "flip", "stand", "throw", "turn"};

// Each of them as it was taught, and with what its first row varies. A flip that varies is to
// another face, of which no one motion can know.
std::vector<SkillRow> taught_rows(const std::vector<SkillRow>& controlled) {
  std::vector<SkillRow> rows;
  for (const std::string_view skill : kTaught) {
    const auto row =
        std::ranges::find(controlled, skill, [](const SkillRow& each) { return each.trial.skill; });
    if (row == controlled.end()) continue;
    rows.push_back(taught(*row, false));
    if (skill != "flip") rows.push_back(taught(*row, true));
  }
  return rows;
}

}  // namespace

std::vector<SkillRow> all_skill_rows() {
  std::vector<SkillRow> rows;
  const auto add = [&rows](std::vector<SkillRow> more) {
    std::ranges::move(more, std::back_inserter(rows));
  };
  add(balance_rows());
  add(stand_rows());
  add(turn_rows());
  add(flip_rows());
  add(place_rows());
  add(carry_rows());
  add(draw_rows());
  add(catch_rows());
  add(throw_rows());
  add(taught_rows(rows));
  return rows;
}

}  // namespace trifinger::evaluation
