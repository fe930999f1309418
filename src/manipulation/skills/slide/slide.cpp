// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "parts/grasp_config.hpp"
#include "parts/grasped_motion.hpp"
#include "skills/makers.hpp"

namespace trifinger::manipulation {

std::unique_ptr<Skill> make_slide(const SkillContext& context, const config::Node& root) {
  const config::Range time{.unit = "s", .min = 0, .max = 3600, .above_min = true};
  ManipulationConfig config = read_manipulation(context, root);
  const config::Node slide = root.section("slide");
  read_lead(slide, config);
  config.task =
      SlideTask{.radius = slide.required<double>("radius", {.unit = "m", .min = 0, .max = 0.5}),
                .turns = slide.required<double>("turns", {.min = -1000, .max = 1000}),
                .period = Seconds(slide.required<double>("period", time)),
                .ramp_time = Seconds(slide.required<double>("ramp_time", time)),
                .table_share = slide.required<double>("table_share", {.min = 0, .max = 1}),
                .start_angles = slide.required<int>("start_angles", {.min = 1, .max = 360})};
  return std::make_unique<GraspedMotion>(context, config);
}

}  // namespace trifinger::manipulation
