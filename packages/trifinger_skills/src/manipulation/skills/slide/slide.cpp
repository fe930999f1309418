// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "manipulation/parts/grasp_config.hpp"
#include "manipulation/parts/grasped_motion.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/skills/makers.hpp"

namespace trifinger::manipulation {

std::unique_ptr<Skill> make_slide(const SkillContext& context, const config::Node& root) {
  const config::Node slide = root.section("slide");
  const ManipulationConfig config = read_manipulation(
      context, root, slide,
      SlideTask{.radius = slide.required<double>("radius", {.unit = "m", .min = 0, .max = 0.5}),
                .turns = slide.required<double>("turns", {.min = -1000, .max = 1000}),
                .period = read_time(slide, "period"),
                .ramp_time = read_time(slide, "ramp_time"),
                .table_share = slide.required<double>("table_share", {.min = 0, .max = 1}),
                .start_angles = slide.required<int>("start_angles", {.min = 1, .max = 360})},
      {});
  return std::make_unique<GraspedMotion>(context, config);
}

}  // namespace trifinger::manipulation
