// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/skills.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "base/suggestion.hpp"
#include "manipulation/skills/makers.hpp"
#include "manipulation/taught_motion.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::manipulation {
namespace {

struct Entry {
  SkillInfo info;
  SkillMaker make;
};

// A skill is a folder in src/manipulation/skills, a configuration, and an entry here.
const std::vector<Entry>& entries() {
  static const std::vector<Entry> all{
      {{.name = "balance",
        .summary = "Balances a cuboid upright on one fingertip",
        .robot = "sim_balance"},
       make_balance},
      {{.name = "carry",
        .summary = "Carries a cube to any pose in the air and holds it there",
        .robot = "pushing"},
       make_carry},
      {{.name = "catch",
        .summary = "Catches a ball that falls to a flipped robot",
        .robot = "catch"},
       make_catch},
      {{.name = "draw",
        .summary = "Takes a pen from its holder, writes a word, and puts it back",
        .robot = "sim_pen"},
       make_draw},
      {{.name = "flip",
        .summary = "Flips a cube so that another face looks up",
        .robot = "pushing"},
       make_flip},
      {{.name = "lift", .summary = "Lifts a cube, holds it, and puts it down", .robot = "pushing"},
       make_lift},
      {{.name = "place", .summary = "Brings a cube on the table to any poses", .robot = "pushing"},
       make_place},
      {{.name = "slide", .summary = "Slides a cube on a circle", .robot = "sim"}, make_slide},
      {{.name = "stand",
        .summary = "Stands a flat cuboid up that lies on its side",
        .robot = "sim_cuboid"},
       make_stand},
      {{.name = "throw",
        .summary = "Throws a ball that lies on the tips of a flipped robot",
        .robot = "throw"},
       make_throw},
      {{.name = "turn",
        .summary = "Turns a cube by 90 degrees with one finger while the others hold it",
        .robot = "sim"},
       make_turn},
  };
  return all;
}

const Entry& entry_of(const std::string& name) {
  const auto found =
      std::ranges::find(entries(), name, [](const Entry& entry) { return entry.info.name; });
  if (found != entries().end()) return *found;
  std::vector<std::string_view> names;
  for (const SkillInfo& info : all_skills()) names.push_back(info.name);
  throw InvalidArgument("there is no skill '" + name + "', only " + quoted_list(names, "and"));
}

}  // namespace

config::File load_skill_file(const std::string& config, const std::vector<std::string>& overrides) {
  constexpr const char* kFolder = "skills";
  return config::File::load(find_config(config, kFolder), overrides, config_folders(kFolder));
}

std::string default_config(const std::string& name, const SkillContext& context) {
  std::string of_variant = name + "_";
  of_variant += variant_figures(context.description.variant).name;
  const std::vector<std::string> names = config_names("skills");
  return std::ranges::find(names, of_variant) != names.end() ? of_variant : name;
}

std::span<const SkillInfo> all_skills() noexcept {
  static const std::vector<SkillInfo> all = [] {
    std::vector<SkillInfo> infos;
    for (const Entry& entry : entries()) infos.push_back(entry.info);
    return infos;
  }();
  return all;
}

std::unique_ptr<Skill> make_skill(const std::string& name, const SkillContext& context,
                                  const std::string& config,
                                  const std::vector<std::string>& overrides) {
  const Entry& entry = entry_of(name);
  const config::File file =
      load_skill_file(config.empty() ? default_config(name, context) : config, overrides);
  const config::Node root = file.root();
  if (const auto made_for = root.required<std::string>("skill"); made_for != name) {
    throw config::ConfigError(root.at("skill").location(),
                              "this file is for the skill '" + made_for + "', not '" + name + "'");
  }
  std::unique_ptr<Skill> skill = entry.make(context, root);
  file.reject_unknown_keys();
  return skill;
}

std::unique_ptr<Skill> make_taught_skill(const std::string& name, const SkillContext& context,
                                         const std::string& config,
                                         const std::vector<std::string>& overrides) {
  std::unique_ptr<Skill> skill = make_skill(name, context, config, overrides);
  for (const std::filesystem::path& folder : config_folders("skills/taught")) {
    const std::filesystem::path file = folder / (name + ".csv");
    if (std::filesystem::exists(file))
      return play_instead(std::move(skill), context, load_taught_motion(file));
  }
  throw InvalidArgument("nobody has taught '" + name + "' yet");
}

}  // namespace trifinger::manipulation
