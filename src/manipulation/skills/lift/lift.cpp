// SPDX-License-Identifier: BSD-3-Clause
#include "skills/lift/lift.hpp"

#include <memory>

#include "parts/grasp_config.hpp"
#include "parts/grasped_motion.hpp"
#include "skills/makers.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::manipulation {
namespace {

ManipulationConfig read(const SkillContext& context, const config::Node& root) {
  const config::Range time{.unit = "s", .min = 0, .max = 3600, .above_min = true};
  ManipulationConfig config = read_manipulation(context, root);
  const config::Node lift = root.section("lift");
  read_lead(lift, config);
  config.lead.distances =
      lift.required<std::vector<double>>("lead_distances", {.min = 0, .max = 1});
  config.task =
      LiftTask{.height = lift.required<double>("height", {.unit = "m", .min = 0, .max = 0.5}),
               .lift_time = Seconds(lift.required<double>("time", time)),
               .hold_time = Seconds(lift.required<double>("hold_time", {.unit = "s", .min = 0})),
               .lower_time = Seconds(lift.required<double>("lower_time", time))};
  return config;
}

}  // namespace

ManipulationConfig load_lift(const SkillContext& context,
                             const std::vector<std::string>& overrides) {
  const config::File file = load_skill_file(default_config("lift", context), overrides);
  return read(context, file.root());
}

std::unique_ptr<Skill> make_lift(const SkillContext& context, const config::Node& root) {
  return std::make_unique<GraspedMotion>(context, read(context, root));
}

}  // namespace trifinger::manipulation
