// SPDX-License-Identifier: BSD-3-Clause
#include "read_file_robot.hpp"

#include <memory>
#include <utility>

#include "base/text_of.hpp"
#include "in_seconds.hpp"
#include "joint/every_joint.hpp"
#include "read_motors.hpp"
#include "read_object.hpp"
#include "read_simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/read_backend.hpp"
#include "trifinger/joint/read_limits.hpp"

namespace trifinger {
namespace {

using config::File;
using config::Node;

// What holds if a configuration has no section "backend". The period is that of the robot's file.
constexpr const char* kUsualBackend = R"(
mode: real_time
history: 16384
access: owner
late_action: {policy: repeat, max_repeats: 100}
max_skipped_ticks: 100
max_late_steps: 1000000
max_measurement_age: .inf
max_rejected_actions: 10
first_action_timeout: .inf
)";

// The node that names the robot's file.
Node file_node(const Node& robot) {
  const auto mjcf = robot.find("mjcf");
  const auto urdf = robot.find("urdf");
  if (mjcf && urdf) urdf->fail("is a second file of the robot, beside robot.mjcf");
  return mjcf ? *mjcf : *urdf;
}

// Reads the model, and what was identified of its joints.
void read_model(const Node& root, const std::optional<Node>& period,
                SimulationOptions& simulation) {
  const Node robot = root.section("robot");
  const Node path = file_node(robot);
  ModelFileOptions options{.path = path.as<std::string>()};
  if (const auto meshes = robot.find("mesh_folder")) {
    // Beside the file, unless it says otherwise.
    options.mesh_folder = options.path.parent_path() / meshes->as<std::string>();
  }
  options.repair_inertia = robot.optional("repair_inertia", false);
  options.angle_in_radians =
      robot.optional_choice("angle", false, {{"degree", false}, {"radian", true}});
  options.exclude_overlaps = robot.optional("exclude_overlaps", false);
  options.collision = robot.optional_choice("collision", UrdfCollision::kHull,
                                            {{"hull", UrdfCollision::kHull},
                                             {"visual", UrdfCollision::kVisual},
                                             {"none", UrdfCollision::kNone}});
  options.joints = robot.optional<std::vector<std::string>>("joints", {});
  if (period) options.period = read_period(*period);
  if (const auto objects = root.find("objects")) options.objects = detail::read_objects(*objects);
  const auto armature = robot.optional_section("armature");
  const auto every = armature ? armature->find(detail::kEveryJoint) : std::nullopt;
  options.armature = [&](const std::string& joint) -> std::optional<double> {
    const auto own = armature ? armature->find(joint) : std::nullopt;
    if (!own && !every) return std::nullopt;
    return (own ? *own : *every).as<double>({.min = 0, .max = kLargestJointLimit});
  };
  if (const auto keyframe = robot.find("keyframe")) options.keyframe = keyframe->as<std::string>();
  const auto start = robot.optional_section("initial_position");
  options.initial_position = [&](const ModelJoint& joint) -> std::optional<double> {
    const auto value = start ? start->find(joint.name) : std::nullopt;
    if (!value) return std::nullopt;
    return value->as<double>({.unit = joint.is_slide ? "m" : "rad"});
  };
  try {
    auto model = std::make_shared<ModelFile>(std::move(options));
    simulation.identified = detail::read_identified(root, model->joints().size(), model->period());
    model->adopt(simulation.identified);
    for (const ModelJoint& joint : model->model_joints()) detail::require_other_name(joint.name);
    for (const DrivenJoint& joint : model->joints()) detail::require_other_name(joint.name);
    simulation.file = model;
  } catch (const InvalidArgument& error) {
    throw config::ConfigError(path.location(), error.what());
  }
}

}  // namespace

namespace detail {

Node file_node(const Node& root) { return trifinger::file_node(root.section("robot")); }

RobotConfig read_file_robot(const File& file) {
  const Node root = file.root();
  RobotConfig config;
  SimulationOptions& simulation = config.simulation;
  config.name = root.required<std::string>("name");
  const auto backend = root.optional_section("backend");
  const std::optional<Node> period = backend ? backend->find("period") : std::nullopt;
  read_model(root, period, simulation);
  if (backend) {
    config.backend = read_backend(*backend, config.session);
  } else {
    const File usual =
        File::parse(std::string(kUsualBackend) +
                        "period: " + detail::text_of(detail::in_seconds(simulation.file->period())),
                    "backend");
    config.backend = read_backend(usual.root(), config.session);
    config.backend.period = simulation.file->period();
  }
  simulation.period = config.backend.period;
  simulation.limits = read_limits_by_name(root, joints_of(*simulation.file));
  simulation.stop = read_stop(root, simulation);
  if (const auto section = root.optional_section("simulation")) {
    read_simulation(*section, Missing::kUsual, simulation);
  }
  read_motors(root, config);
  read_sight(root, config);
  file.reject_unknown_keys();
  config.session.documents = {{"configuration.yml", "application/yaml", file.text()}};
  return config;
}

}  // namespace detail
}  // namespace trifinger
