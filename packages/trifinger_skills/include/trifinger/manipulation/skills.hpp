// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

/// What is known of a skill before it is made.
struct SkillInfo {
  std::string_view name;     ///< NAME in `trifinger manipulate NAME`.
  std::string_view summary;  ///< One line for a help text.
  std::string_view robot;    ///< A configuration of a robot on which it works.
};

/// All skills that come with the program, in the order of their names.
[[nodiscard]] std::span<const SkillInfo> all_skills() noexcept;

/// Makes a skill. `config` is the path of a configuration, or the name of one that comes with the
/// program; empty for the one with the name of the skill, or of the skill and the robot's variant,
/// such as "lift_pro". The files in config/skills document every key.
/// @throws InvalidArgument that names the existing skills, or says what the robot lacks;
/// config::ConfigError at the value that is wrong
[[nodiscard]] std::unique_ptr<Skill> make_skill(const std::string& name,
                                                const SkillContext& context,
                                                const std::string& config = {},
                                                const std::vector<std::string>& overrides = {});

/// The same skill, played instead of controlled: the motion that comes with the program as
/// config/skills/taught/NAME.csv, whatever the object does. See `play_instead`.
/// @throws InvalidArgument also if there is no such motion
[[nodiscard]] std::unique_ptr<Skill> make_taught_skill(
    const std::string& name, const SkillContext& context, const std::string& config = {},
    const std::vector<std::string>& overrides = {});

}  // namespace trifinger::manipulation
