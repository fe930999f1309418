// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "trifinger/config/file.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/manipulation/skill.hpp"

// One function for each skill: reads its configuration and makes it.
namespace trifinger::manipulation {

// The configuration of a skill: the file of this name in config/skills, or this path.
// Throws config::ConfigError, InvalidArgument, SystemError.
[[nodiscard]] config::File load_skill_file(const std::string& config,
                                           const std::vector<std::string>& overrides);

// Name of the configuration that comes with the program for this skill: NAME_VARIANT if there is
// one for the robot's variant, such as "lift_pro", else NAME.
[[nodiscard]] std::string default_config(const std::string& name, const SkillContext& context);

using SkillMaker = std::unique_ptr<Skill> (*)(const SkillContext& context,
                                              const config::Node& root);

[[nodiscard]] std::unique_ptr<Skill> make_balance(const SkillContext& context,
                                                  const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_carry(const SkillContext& context,
                                                const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_catch(const SkillContext& context,
                                                const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_draw(const SkillContext& context,
                                               const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_flip(const SkillContext& context,
                                               const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_lift(const SkillContext& context,
                                               const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_place(const SkillContext& context,
                                                const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_slide(const SkillContext& context,
                                                const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_stand(const SkillContext& context,
                                                const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_throw(const SkillContext& context,
                                                const config::Node& root);
[[nodiscard]] std::unique_ptr<Skill> make_turn(const SkillContext& context,
                                               const config::Node& root);

}  // namespace trifinger::manipulation
