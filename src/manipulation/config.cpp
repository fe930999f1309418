// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/config.hpp"

#include "parts/grasp_config.hpp"
#include "parts/read_time.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/sim/robot_config.hpp"

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

// Reads the keys that lifting and sliding share.
void read_places(const Node& section, ManipulationConfig& config) {
  config.planner.friction = section.required<double>("planned_friction", kFriction);
  config.planner.friction_sides = config.controller.friction_sides;
  config.planner.min_normal_force = config.controller.min_normal_force;
  config.lead.turns = section.required<std::vector<double>>("lead_turns", kAngle);
  config.lead.turn_cost = section.required<double>("lead_turn_cost", {.min = 0, .max = 10});
  config.lead.time = read_time(section, "lead_time");
}

void read_lift(const Node& section, ManipulationConfig& config) {
  read_places(section, config);
  config.lead.distances =
      section.required<std::vector<double>>("lead_distances", {.min = 0, .max = 1});
  config.task = LiftTask{.height = section.required<double>("height", kLength),
                         .lift_time = read_time(section, "time"),
                         .hold_time = read_time(section, "hold_time", {.unit = "s", .min = 0}),
                         .lower_time = read_time(section, "lower_time")};
}

void read_slide(const Node& section, ManipulationConfig& config) {
  read_places(section, config);
  config.task =
      SlideTask{.radius = section.required<double>("radius", kLength),
                .turns = section.required<double>("turns", {.min = -1000, .max = 1000}),
                .period = read_time(section, "period"),
                .ramp_time = read_time(section, "ramp_time"),
                .table_share = section.required<double>("table_share", {.min = 0, .max = 1}),
                .start_angles = section.required<int>("start_angles", {.min = 1, .max = 360})};
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
}

ManipulationConfig load_config(const std::string& name, const std::string& task,
                               const std::vector<std::string>& overrides) {
  constexpr const char* kFolder = "manipulate";
  const config::File file =
      config::File::load(find_config(name, kFolder), overrides, config_folders(kFolder));
  const Node root = file.root();
  ManipulationConfig config;
  config.object = root.required<std::string>("object");
  config.look_time = read_time(root, "look_time");
  config.max_grasps = root.required<int>("max_grasps", {.min = 1, .max = 100});
  config.max_duration = read_time(root, "max_duration");
  read_grasping(root, config);
  // Both sections are read, so that a mistake in either is reported.
  ManipulationConfig other = config;
  const bool is_lift = task == "lift";
  if (!is_lift && task != "slide")
    throw InvalidArgument("the task is '" + task + "', must be 'lift' or 'slide'");
  read_lift(root.section("lift"), is_lift ? config : other);
  read_slide(root.section("slide"), is_lift ? other : config);
  file.reject_unknown_keys();
  return config;
}

}  // namespace trifinger::manipulation
