// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/lift/lift.hpp"

#include <memory>

#include "manipulation/parts/grasp_config.hpp"
#include "manipulation/parts/grasped_motion.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/skills/makers.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::manipulation {
namespace {

ManipulationConfig read_lift(const SkillContext& context, const config::Node& root) {
  const config::Node lift = root.section("lift");
  return read_manipulation(
      context, root, lift,
      LiftTask{.height = lift.required<double>("height", {.unit = "m", .min = 0, .max = 0.5}),
               .lift_time = read_time(lift, "time"),
               .hold_time = read_time(lift, "hold_time", {.unit = "s", .min = 0}),
               .lower_time = read_time(lift, "lower_time")},
      lift.required<std::vector<double>>("lead_distances", {.min = 0, .max = 1}));
}

}  // namespace

ManipulationConfig load_lift(const SkillContext& context,
                             const std::vector<std::string>& overrides) {
  const config::File file = load_skill_file(default_config("lift", context), overrides);
  return read_lift(context, file.root());
}

std::unique_ptr<Skill> make_lift(const SkillContext& context, const config::Node& root) {
  return std::make_unique<GraspedMotion>(context, read_lift(context, root));
}

}  // namespace trifinger::manipulation
