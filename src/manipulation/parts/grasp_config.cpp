// SPDX-License-Identifier: BSD-3-Clause
#include "parts/grasp_config.hpp"

#include <vector>

#include "parts/read_time.hpp"
#include "skills/makers.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;

constexpr Range kLength{.unit = "m", .min = 0, .max = 0.5};
constexpr Range kForce{.unit = "N", .min = 0, .max = 50, .above_min = true};
constexpr Range kFriction{.min = 0, .max = 5, .above_min = true};
constexpr Range kAngle{.unit = "rad", .min = -3.15, .max = 3.15};

void read_grasp(const Node& section, control::GraspControllerConfig& grasp) {
  grasp.friction = section.required<double>("friction", kFriction);
  grasp.friction_sides = section.required<int>("friction_sides", {.min = 3, .max = 8});
  grasp.slip_friction = section.required<double>("slip_friction", kFriction);
  grasp.min_normal_force = section.required<double>("min_normal_force", kForce);
  grasp.max_normal_force = section.required<double>("max_normal_force", kForce);
  grasp.touch_force = section.required<double>("touch_force", kForce);
  const Range speed{.unit = "m/s", .min = 0, .max = 1, .above_min = true};
  grasp.approach_speed = section.required<double>("approach_speed", speed);
  grasp.closing_speed = section.required<double>("closing_speed", speed);
  const Range stiffness{.unit = "N/m", .min = 0, .max = 5000, .above_min = true};
  const Range damping{.unit = "Ns/m", .min = 0, .max = 100};
  grasp.tips.stiffness = section.required<double>("tip_stiffness", stiffness);
  grasp.tips.damping = section.required<double>("tip_damping", damping);
  grasp.object.stiffness = section.required<double>("object_stiffness", stiffness);
  grasp.object.damping = section.required<double>("object_damping", damping);
  grasp.object.rotational_stiffness = section.required<double>(
      "object_rotational_stiffness", {.unit = "Nm/rad", .min = 0, .max = 10});
  grasp.object.rotational_damping = section.required<double>(
      "object_rotational_damping", {.unit = "Nms/rad", .min = 0, .max = 1});
  grasp.roll_time = read_time(section, "roll_time");
}

}  // namespace

void read_grasping(const Node& root, ManipulationConfig& config) {
  config.pose_bandwidth = root.required<double>(
      "pose_bandwidth", {.unit = "Hz", .min = 0, .max = 100, .above_min = true});
  config.planner.offsets = root.required<std::vector<double>>("offsets", kLength);
  config.planner.heights =
      root.required<std::vector<double>>("heights", {.unit = "m", .min = -0.1, .max = 0.1});
  config.planner.largest_torque =
      root.required<double>("largest_torque", {.min = 0, .max = 1, .above_min = true});
  read_grasp(root.section("grasp"), config.controller);
  config.planner.friction_sides = config.controller.friction_sides;
  config.planner.min_normal_force = config.controller.min_normal_force;
}

ManipulationConfig read_manipulation(const SkillContext& context, const Node& root) {
  ManipulationConfig config;
  config.object = root.required<std::string>("object");
  config.look_time = read_time(root, "look_time");
  config.max_grasps = root.required<int>("max_grasps", {.min = 1, .max = 100});
  config.max_duration = read_time(root, "max_duration");
  read_grasping(root, config);
  config.planner.limits = context.limits;
  config.controller.limits = context.limits;
  return config;
}

void read_lead(const Node& section, ManipulationConfig& config) {
  config.planner.friction = section.required<double>("planned_friction", kFriction);
  config.lead.turns = section.required<std::vector<double>>("lead_turns", kAngle);
  config.lead.turn_cost = section.required<double>("lead_turn_cost", {.min = 0, .max = 10});
  config.lead.time = read_time(section, "lead_time");
}

ManipulationConfig load_grasping(const SkillContext& context, const std::string& name) {
  const config::File file = load_skill_file(name, {});
  ManipulationConfig config = read_manipulation(context, file.root());
  file.reject_unknown_keys();
  return config;
}

}  // namespace trifinger::manipulation
