// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/skill_rows.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

#include "evaluation/cube_trial.hpp"

namespace trifinger::evaluation {
namespace {

// The same row, played as it was taught, with or without what varies. Nobody asks for a rate: what
// comes out is reported.
SkillRow taught(SkillRow row, bool varies) {
  row.name = (varies ? "taught-varied-" : "taught-") + row.name;
  row.what = (varies ? "taught, varied: " : "taught, as it was taught: ") + row.what;
  row.reach = "stated";
  row.needed = 0.0;
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

// Rows of the skills whose motions are in config/skills/taught.
constexpr std::array<std::string_view, 5> kTaught{"draw", "flip", "stand", "throw-once", "turn"};

// Each of them as it was taught, and with what it varies. A flip that varies is to
// another face, of which no one motion can know.
std::vector<SkillRow> taught_rows(const std::vector<SkillRow>& controlled) {
  std::vector<SkillRow> rows;
  for (const std::string_view name : kTaught) {
    const auto row = std::ranges::find(controlled, name, &SkillRow::name);
    if (row == controlled.end()) continue;
    rows.push_back(taught(*row, false));
    if (name != "flip") rows.push_back(taught(*row, true));
  }
  return rows;
}

std::vector<SkillRow> skill_rows() {
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

// The same over emulated motor boards.
SkillRow on_boards(SkillRow row, const std::vector<std::string>& settings) {
  row.like = row.name;
  row.name += "-on-boards";
  row.what = "over emulated motor boards: " + row.what;
  row.trial = make_skill_trial("trifinger_edu_emulated", row.trial.skill, settings);
  return row;
}

std::vector<SkillRow> control_rows() {
  std::vector<SkillRow> rows = lift_rows();
  const SkillRow lift = rows.front();
  std::vector<SkillRow> slides = slide_rows();
  const SkillRow slide = slides.front();
  std::ranges::move(slides, std::back_inserter(rows));
  rows.push_back(on_boards(lift, {"fingers.height=0.3"}));
  rows.push_back(on_boards(slide, {}));
  return rows;
}

constexpr TimeIndex kImagePeriod = 33;  // Steps between two images.
constexpr TimeIndex kImageDelay = 35;   // Steps from an image to the pose in it.

SkillTrial seeing(const std::string& skill, std::vector<std::string> settings,
                  const std::vector<std::string>& skill_settings) {
  settings.insert(settings.end(), {"cameras.rate=30", "cameras.delay=0.035"});
  return make_skill_trial("sim_tracked", skill, settings, skill_settings);
}

// The same with exact poses that are as late and as seldom, for comparison.
SkillRow knowing(SkillRow row, const std::vector<std::string>& settings,
                 const std::vector<std::string>& skill_settings) {
  row.name += "-known";
  row.what += ", poses exact and as late";
  row.reach = "for comparison";
  row.needed = 0.0;
  row.trial = make_skill_trial("sim", row.trial.skill, settings, skill_settings);
  row.vary = [](SkillTrial& trial, std::uint64_t seed) {
    trial = varied(trial, seed);
    trial.simulation.object_period = kImagePeriod;
    trial.simulation.object_delay = kImageDelay;
    trial.simulation.object_position_noise = 0;
    trial.simulation.object_orientation_noise = 0;
  };
  return row;
}

std::vector<SkillRow> vision_rows() {
  const Limits near{.position_rms = 3 * kMillimetre};
  const std::vector<std::string> raised{"fingers.height=0.3"};
  const std::vector<std::string> low{"lift.height=0.15"};
  const SkillRow lift = lift_row("lift-seen", "lift a cube 15 cm, by sight", "19 of 20; 3 mm rms",
                                 0.95, seeing("lift", raised, low), near, {.height = 0.15});
  const SkillRow slide = slide_row("slide-seen", "slide a cube on a circle of 5 cm, by sight",
                                   "19 of 20; 3 mm rms", 0.95, seeing("slide", {}, {}), near);
  return {lift, knowing(lift, raised, low), slide, knowing(slide, {}, {}),
          lift_row("lift-out-of-sight", "lift a cube 20 cm, out of sight at the top",
                   "19 of 20 put back", 0.95, seeing("lift", raised, {}))};
}

}  // namespace

std::vector<Table> all_tables() {
  return {{.name = "skills", .rows = skill_rows()},
          {.name = "control", .rows = control_rows()},
          {.name = "vision", .rows = vision_rows()}};
}

}  // namespace trifinger::evaluation
