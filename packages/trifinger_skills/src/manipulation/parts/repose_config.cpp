// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <array>
#include <utility>

#include "manipulation/parts/grasp_config.hpp"
#include "manipulation/parts/repose.hpp"
#include "manipulation/parts/settings.hpp"
#include "model/rotation_between.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;

constexpr Range kShort = above_zero("s", 10);
constexpr Range kLong = above_zero("s", 100);
constexpr Range kShare{.min = 0, .max = 1};
constexpr Range kSomeShare = above_zero("", 1);
constexpr Range kDistance = above_zero("m", 1);
constexpr Range kWeight{.min = 0, .max = 1e6};

PushWeights read_weights(const Node& section, std::string_view key) {
  const auto weights = section.required<std::array<double, 3>>(key, kWeight);
  return {.position = weights[0], .orientation = weights[1], .tips = weights[2]};
}

control::PlannerOptions read_planner(const Node& section) {
  const Range sigma = above_zero("rad", 3);
  const control::PlannerOptions planner{
      .samples = section.required<int>("samples", {.min = 2, .max = 10000}),
      .horizon = read_time(section, "horizon", above_zero("s", 5)),
      .knots = section.required<int>("knots", {.min = 2, .max = 100}),
      .kp = section.required<double>("kp", above_zero("Nm/rad", 50)),
      .kd = section.required<double>("kd", {.unit = "Nms/rad", .min = 0, .max = 1}),
      .least_sigma = section.required<double>("least_sigma", sigma),
      .most_sigma = section.required<double>("most_sigma", sigma),
      .one_finger_share = section.required<double>("one_finger_share", kShare),
      .constant_share = section.required<double>("constant_share", kShare),
      .temperature = section.required<double>("temperature", above_zero("", 10)),
      .num_threads = 1,  // The other processors are for the robot and its loop.
      .seed = section.required<std::uint64_t>("seed", {.min = 0})};
  if (planner.most_sigma < planner.least_sigma) {
    throw config::ConfigError(section.at("most_sigma").location(),
                              "plan.most_sigma is below plan.least_sigma");
  }
  return planner;
}

PushConfig read_push(const Node& plan, const Node& cost) {
  const Range period = above_zero("s", 1);
  return {.planner = read_planner(plan),
          .model = {.time_step = read_time(plan, "time_step", above_zero("s", 0.01))},
          .plan_period = read_time(plan, "period", period),
          .plan_delay = read_time(plan, "delay", period),
          .pose_gain = plan.required<double>("pose_gain", kSomeShare),
          .placing = read_weights(cost, "placing"),
          .turning = read_weights(cost, "turning"),
          .moving = read_weights(cost, "moving"),
          .weights_time = read_time(cost, "weights_time", kLong),
          .far = cost.required<double>("far", kDistance),
          .near = cost.required<double>("near", kDistance),
          .tip_distance = cost.required<double>("tip_distance", {.unit = "m", .min = 0, .max = 1}),
          .target_cost = cost.required<double>("targets", kWeight),
          .speed_cost = cost.required<double>("speed", kWeight),
          .spin_cost = cost.required<double>("spin", kWeight),
          .retreat_distance = cost.required<double>("retreat_distance", kDistance)};
}

}  // namespace

ReposeConfig read_repose(const Node& root) {
  return {
      .object = root.required<std::string>("object"),
      .max_duration = read_time(root, "max_duration"),
      .look_time = read_time(root, "look_time", kShort),
      .position_tolerance = root.required<double>("position_tolerance", above_zero("m", 0.1)),
      .orientation_tolerance = root.required<double>("orientation_tolerance", above_zero("rad", 1)),
      .closeness = root.required<double>("closeness", kSomeShare),
      .settle_time = read_time(root, "settle_time", {.unit = "s", .min = 0, .max = 10}),
      .leave_time = read_time(root, "leave_time", kShort),
      .stuck_time = read_time(root, "stuck_time", kLong),
      .fetch_distance = root.required<double>("fetch_distance", kDistance),
      .push = read_push(root.section("plan"), root.section("cost")),
      .carry = {}};
}

CarrierConfig read_carrier(const SkillContext& context, const Node& section,
                           const std::string& object) {
  const Range speed = above_zero("m/s", 1);
  GraspingConfig grasp = load_grasping(context, section, object);
  grasp.controller.approach_speed = section.required<double>("approach_speed", speed);
  grasp.controller.closing_speed = section.required<double>("closing_speed", speed);
  return {.grasp = std::move(grasp),
          .middle = section.required<double>("middle", kDistance),
          .near_angle = section.required<double>("near_angle", above_zero("rad", 1)),
          .drag_distance = section.required<double>("drag_distance", kDistance),
          .height = section.required<double>("height", kDistance),
          .speed = section.required<double>("speed", speed),
          .turn_speed = section.required<double>("turn_speed", above_zero("rad/s", 10)),
          .least_time = read_time(section, "least_time", kShort),
          .lower_time = read_time(section, "lower_time", kShort)};
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
      is_below ? Eigen::Quaterniond(0, 1, 0, 0) : rotation_between(face, z);
  return Eigen::AngleAxisd(turn, z) * up;
}

}  // namespace trifinger::manipulation
