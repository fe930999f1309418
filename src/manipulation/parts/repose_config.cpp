// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "parts/grasp_config.hpp"
#include "parts/read_time.hpp"
#include "parts/repose.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;

constexpr Range kShort{.unit = "s", .min = 0, .max = 10, .above_min = true};
constexpr Range kLong{.unit = "s", .min = 0, .max = 100, .above_min = true};
constexpr Range kShare{.min = 0, .max = 1};
constexpr Range kSomeShare{.min = 0, .max = 1, .above_min = true};
constexpr Range kDistance{.unit = "m", .min = 0, .max = 1, .above_min = true};
constexpr Range kWeight{.min = 0, .max = 1e6};

PushWeights read_weights(const Node& section, std::string_view key) {
  const auto weights = section.required<std::array<double, 3>>(key, kWeight);
  return {.position = weights[0], .orientation = weights[1], .tips = weights[2]};
}

void read_plan(const Node& section, PushConfig& push) {
  const Range period{.unit = "s", .min = 0, .max = 1, .above_min = true};
  push.plan_period = read_time(section, "period", period);
  push.plan_delay = read_time(section, "delay", period);
  control::PlannerOptions& planner = push.planner;
  planner.horizon =
      read_time(section, "horizon", {.unit = "s", .min = 0, .max = 5, .above_min = true});
  planner.knots = section.required<int>("knots", {.min = 2, .max = 100});
  planner.samples = section.required<int>("samples", {.min = 2, .max = 10000});
  const Range sigma{.unit = "rad", .min = 0, .max = 3, .above_min = true};
  planner.least_sigma = section.required<double>("least_sigma", sigma);
  planner.most_sigma = section.required<double>("most_sigma", sigma);
  if (planner.most_sigma < planner.least_sigma) {
    throw config::ConfigError(section.at("most_sigma").location(),
                              "plan.most_sigma is below plan.least_sigma");
  }
  planner.one_finger_share = section.required<double>("one_finger_share", kShare);
  planner.constant_share = section.required<double>("constant_share", kShare);
  planner.temperature =
      section.required<double>("temperature", {.min = 0, .max = 10, .above_min = true});
  planner.kp =
      section.required<double>("kp", {.unit = "Nm/rad", .min = 0, .max = 50, .above_min = true});
  planner.kd = section.required<double>("kd", {.unit = "Nms/rad", .min = 0, .max = 1});
  planner.seed = section.required<std::uint64_t>("seed", {.min = 0});
  // The other processors are for the robot and its loop.
  planner.num_threads = 1;
  push.model.time_step =
      read_time(section, "time_step", {.unit = "s", .min = 0, .max = 0.01, .above_min = true});
  push.pose_gain = section.required<double>("pose_gain", kSomeShare);
}

void read_cost(const Node& section, PushConfig& push) {
  push.placing = read_weights(section, "placing");
  push.turning = read_weights(section, "turning");
  push.moving = read_weights(section, "moving");
  push.weights_time = read_time(section, "weights_time", kLong);
  push.far = section.required<double>("far", kDistance);
  push.near = section.required<double>("near", kDistance);
  push.tip_distance = section.required<double>("tip_distance", {.unit = "m", .min = 0, .max = 1});
  push.target_cost = section.required<double>("targets", kWeight);
  push.speed_cost = section.required<double>("speed", kWeight);
  push.spin_cost = section.required<double>("spin", kWeight);
  push.retreat_distance = section.required<double>("retreat_distance", kDistance);
}

}  // namespace

ReposeConfig read_repose(const Node& root) {
  ReposeConfig config;
  config.object = root.required<std::string>("object");
  config.max_duration =
      read_time(root, "max_duration", {.unit = "s", .min = 0, .max = 3600, .above_min = true});
  config.look_time = read_time(root, "look_time", kShort);
  config.position_tolerance = root.required<double>(
      "position_tolerance", {.unit = "m", .min = 0, .max = 0.1, .above_min = true});
  config.orientation_tolerance = root.required<double>(
      "orientation_tolerance", {.unit = "rad", .min = 0, .max = 1, .above_min = true});
  config.closeness = root.required<double>("closeness", kSomeShare);
  config.settle_time = read_time(root, "settle_time", {.unit = "s", .min = 0, .max = 10});
  config.leave_time = read_time(root, "leave_time", kShort);
  config.stuck_time = read_time(root, "stuck_time", kLong);
  config.fetch_distance = root.required<double>("fetch_distance", kDistance);
  read_plan(root.section("plan"), config.push);
  read_cost(root.section("cost"), config.push);
  return config;
}

CarrierConfig read_carrier(const SkillContext& context, const Node& section,
                           const std::string& object) {
  const Range speed{.unit = "m/s", .min = 0, .max = 1, .above_min = true};
  CarrierConfig carry;
  carry.grasp = load_grasping(context, section.required<std::string>("grasp"));
  carry.grasp.planner.friction =
      section.required<double>("planned_friction", {.min = 0, .max = 5, .above_min = true});
  carry.grasp.object = object;
  carry.grasp.controller.approach_speed = section.required<double>("approach_speed", speed);
  carry.grasp.controller.closing_speed = section.required<double>("closing_speed", speed);
  carry.middle = section.required<double>("middle", kDistance);
  carry.near_angle = section.required<double>(
      "near_angle", {.unit = "rad", .min = 0, .max = 1, .above_min = true});
  carry.drag_distance = section.required<double>("drag_distance", kDistance);
  carry.height = section.required<double>("height", kDistance);
  carry.speed = section.required<double>("speed", speed);
  carry.turn_speed = section.required<double>(
      "turn_speed", {.unit = "rad/s", .min = 0, .max = 10, .above_min = true});
  carry.least_time = read_time(section, "least_time", kShort);
  carry.lower_time = read_time(section, "lower_time", kShort);
  return carry;
}

Eigen::Vector3d read_face(const Node& section, std::string_view key) {
  using Eigen::Vector3d;
  return section.required_choice<Vector3d>(key, {{"+x", Vector3d::UnitX()},
                                                 {"-x", -Vector3d::UnitX()},
                                                 {"+y", Vector3d::UnitY()},
                                                 {"-y", -Vector3d::UnitY()},
                                                 {"+z", Vector3d::UnitZ()},
                                                 {"-z", -Vector3d::UnitZ()}});
}

Eigen::Quaterniond lying_on(const Eigen::Vector3d& face, double turn) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  // Half a turn has no shortest way; it is about x.
  const bool is_below = face.dot(z) < -0.5;
  const Eigen::Quaterniond up =
      is_below ? Eigen::Quaterniond(0, 1, 0, 0) : Eigen::Quaterniond::FromTwoVectors(face, z);
  return Eigen::AngleAxisd(turn, z) * up;
}

}  // namespace trifinger::manipulation
