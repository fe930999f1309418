// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/grasp_config.hpp"

#include <utility>
#include <vector>

#include "manipulation/parts/settings.hpp"
#include "manipulation/skills/makers.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;

constexpr Range kLength{.unit = "m", .min = 0, .max = 0.5};
constexpr Range kForce = above_zero("N", 50);
constexpr Range kFriction = above_zero("", 5);
constexpr Range kHeight{.unit = "m", .min = -0.1, .max = 0.1};
constexpr Range kAngle{.unit = "rad", .min = -3.15, .max = 3.15};

control::GraspControllerConfig read_controller(const Node& section,
                                               const control::SafetyLimits& limits) {
  const Range speed = above_zero("m/s", 1);
  const Range stiffness = above_zero("N/m", 5000);
  const Range damping{.unit = "Ns/m", .min = 0, .max = 100};
  return {.object = {.stiffness = section.required<double>("object_stiffness", stiffness),
                     .damping = section.required<double>("object_damping", damping),
                     .rotational_stiffness = section.required<double>(
                         "object_rotational_stiffness", {.unit = "Nm/rad", .min = 0, .max = 10}),
                     .rotational_damping = section.required<double>(
                         "object_rotational_damping", {.unit = "Nms/rad", .min = 0, .max = 1})},
          .tips = {.stiffness = section.required<double>("tip_stiffness", stiffness),
                   .damping = section.required<double>("tip_damping", damping)},
          .friction = section.required<double>("friction", kFriction),
          .friction_sides = section.required<int>("friction_sides", {.min = 3, .max = 8}),
          .slip_friction = section.required<double>("slip_friction", kFriction),
          .min_normal_force = section.required<double>("min_normal_force", kForce),
          .max_normal_force = section.required<double>("max_normal_force", kForce),
          .touch_force = section.required<double>("touch_force", kForce),
          .approach_speed = section.required<double>("approach_speed", speed),
          .closing_speed = section.required<double>("closing_speed", speed),
          .roll_time = read_time(section, "roll_time"),
          .limits = limits};
}

GraspingConfig read_grasping(const SkillContext& context, const Node& root, double friction) {
  const control::GraspControllerConfig controller =
      read_controller(root.section("grasp"), context.limits);
  return {.object = root.required<std::string>("object"),
          .look_time = read_time(root, "look_time"),
          .pose_bandwidth = root.required<double>("pose_bandwidth", above_zero("Hz", 100)),
          .error_gain = root.required<double>("error_gain", {.unit = "1/s", .min = 0, .max = 10}),
          .max_grasps = root.required<int>("max_grasps", {.min = 1, .max = 100}),
          .max_duration = read_time(root, "max_duration"),
          .planner = {.offsets = root.required<std::vector<double>>("offsets", kLength),
                      .heights = root.required<std::vector<double>>("heights", kHeight),
                      .friction = friction,
                      .friction_sides = controller.friction_sides,
                      .min_normal_force = controller.min_normal_force,
                      .largest_torque = root.required<double>("largest_torque", above_zero("", 1)),
                      .limits = context.limits},
          .controller = controller};
}

double read_friction(const Node& section) {
  return section.required<double>("planned_friction", kFriction);
}

}  // namespace

ManipulationConfig read_manipulation(const SkillContext& context, const Node& root,
                                     const Node& section, Task task,
                                     std::vector<double> distances) {
  return {read_grasping(context, root, read_friction(section)),
          std::move(task),
          {.turns = section.required<std::vector<double>>("lead_turns", kAngle),
           .distances = std::move(distances),
           .turn_cost = section.required<double>("lead_turn_cost", {.min = 0, .max = 10}),
           .time = read_time(section, "lead_time")}};
}

GraspingConfig load_grasping(const SkillContext& context, const Node& section,
                             const std::string& object) {
  const config::File file = load_skill_file(section.required<std::string>("grasp"), {});
  GraspingConfig config = read_grasping(context, file.root(), read_friction(section));
  file.reject_unknown_keys();
  config.object = object;
  config.max_grasps = 1;
  if (section.find("heights"))
    config.planner.heights = section.required<std::vector<double>>("heights", kHeight);
  return config;
}

}  // namespace trifinger::manipulation
