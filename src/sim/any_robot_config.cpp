// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/any_robot_config.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "from_file.hpp"
#include "in_seconds.hpp"
#include "read_object.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"
#include "trifinger/joint/read_backend.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/sim/file_plant.hpp"

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

std::shared_ptr<const ModelFile> read_model(const Node& root, const std::optional<Node>& period) {
  const Node robot = root.section("robot");
  const Node path = file_node(robot);
  ModelFileOptions options{.path = path.as<std::string>()};
  if (const auto meshes = robot.find("mesh_folder")) {
    // Beside the file, unless it says otherwise.
    options.mesh_folder = options.path.parent_path() / meshes->as<std::string>();
  }
  options.joints = robot.optional<std::vector<std::string>>("joints", {});
  if (period) options.period = read_period(*period);
  if (const auto objects = root.find("objects")) options.objects = detail::read_objects(*objects);
  const auto armature = robot.optional_section("armature");
  const auto every = armature ? armature->find("every_joint") : std::nullopt;
  options.armature = [&](const std::string& joint) -> std::optional<double> {
    const auto own = armature ? armature->find(joint) : std::nullopt;
    if (!own && !every) return std::nullopt;
    return (own ? *own : *every).as<double>({.min = 0, .max = 1e3});
  };
  try {
    return std::make_shared<const ModelFile>(std::move(options));
  } catch (const InvalidArgument& error) {
    throw config::ConfigError(path.location(), error.what());
  }
}

void read_start(const Node& robot, FileRobotOptions& options) {
  if (const auto keyframe = robot.find("keyframe")) {
    options.keyframe = keyframe->as<std::string>();
  }
  const auto section = robot.optional_section("initial_position");
  if (!section) return;
  const auto read = [&](const std::string& name, bool is_slide) {
    const auto value = section->find(name);
    if (!value) return;
    options.initial_position.emplace_back(name,
                                          value->as<double>({.unit = is_slide ? "m" : "rad"}));
  };
  for (const ModelJoint& joint : options.model->model_joints()) read(joint.name, joint.is_slide);
  for (const FileJoint& joint : options.model->joints()) {
    const auto known =
        std::ranges::find(options.model->model_joints(), joint.name, &ModelJoint::name);
    if (known == options.model->model_joints().end()) read(joint.name, joint.is_slide);
  }
}

TimeIndex read_steps(const Node& node, Nanoseconds period) {
  const auto seconds = node.as<double>({.unit = "s", .min = 1e-4, .max = 10});
  const double steps = std::round(seconds / detail::in_seconds(period));
  constexpr double kTolerance = 1e-6;
  if (steps < 1.0 || std::abs(seconds / detail::in_seconds(period) - steps) > kTolerance) {
    node.fail("is " + detail::text_of(seconds) + " s, must be a whole number of steps of " +
              detail::text_of(detail::in_seconds(period)) + " s");
  }
  return static_cast<TimeIndex>(steps);
}

servos::ServoConfig read_servos(const Node& root, const FileRobotOptions& robot,
                                Nanoseconds period) {
  const ModelFile& model = *robot.model;
  std::vector<std::string> joints;
  std::vector<std::string> all;
  for (const FileJoint& joint : model.joints()) joints.push_back(joint.name);
  for (const ModelJoint& joint : model.model_joints()) all.push_back(joint.name);
  servos::ServoConfig config = servos::read_servo_config(root, joints, all);
  config.robot.types = robot_types_of(model);
  config.robot.limits = robot.limits;
  config.robot.period = period;
  config.robot.weight = weight_of(robot);
  const RobotModel::Data data = model.make_data();
  robot.put_at_start(*data);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    config.robot.initial_position.push_back(model.position(i, *data));
  }
  for (const std::string& name : config.sensor_names) {
    const mjModel& mujoco = *model.mujoco();
    const int joint = mj_name2id(&mujoco, mjOBJ_JOINT, name.c_str());
    auto& range = config.robot.sensor_ranges.emplace_back();
    if (mujoco.jnt_limited[joint]) {
      range = {mujoco.jnt_range[2 * joint], mujoco.jnt_range[2 * joint + 1]};
    }
  }
  if (!model.drives_all()) {
    std::vector<std::string> measured = joints;
    measured.insert(measured.end(), config.sensor_names.begin(), config.sensor_names.end());
    for (const std::string& joint : all) {
      const auto found = std::ranges::find(measured, joint);
      config.robot.all_joints.push_back(
          found == measured.end()
              ? std::nullopt
              : std::optional(static_cast<std::size_t>(found - measured.begin())));
    }
  }
  try {
    config.robot.validate();
  } catch (const InvalidArgument& error) {
    root.section("dynamixel").fail(std::string("makes no sense: ") + error.what());
  }
  return config;
}

FileRobotConfig read_file_robot(const File& file) {
  const Node root = file.root();
  FileRobotConfig config;
  config.name = root.required<std::string>("name");
  const bool is_on_motors =
      root.required_choice<bool>("driver", {{"simulation", false}, {"dynamixel", true}});
  const Node robot = root.section("robot");
  const auto backend = root.optional_section("backend");
  const std::optional<Node> period = backend ? backend->find("period") : std::nullopt;
  config.robot.model = read_model(root, period);
  read_start(robot, config.robot);
  if (backend) {
    config.backend = read_backend(*backend, config.session);
  } else {
    const File usual = File::parse(
        std::string(kUsualBackend) +
            "period: " + detail::text_of(detail::in_seconds(config.robot.model->period())),
        "backend");
    config.backend = read_backend(usual.root(), config.session);
    config.backend.period = config.robot.model->period();
  }
  config.robot.limits = read_limits_by_name(root, joints_of(*config.robot.model));
  if (const auto simulation = root.optional_section("simulation")) {
    if (const auto objects = simulation->find("object_period")) {
      config.robot.object_period = read_steps(*objects, config.backend.period);
    }
  }
  if (is_on_motors) {
    // What hardware needs must not be guessed.
    static_cast<void>(root.section("backend"));
    config.servos = read_servos(root, config.robot, config.backend.period);
  }
  file.reject_unknown_keys();
  config.session.documents = {{"configuration.yml", "application/yaml", file.text()}};
  return config;
}

}  // namespace

File load_config_file(const std::string& name, const std::vector<std::string>& overrides) {
  File file = File::load(find_config(name), overrides, config_folders());
  if (!detail::is_from_file(file.root())) return file;
  const Node robot = file.root().section("robot");
  const Node node = file_node(robot);
  std::filesystem::path model = node.as<std::string>();
  // An override counts from the working directory.
  const bool is_override = node.location().line == 0;
  const std::filesystem::path folder =
      is_override ? "" : std::filesystem::path(node.location().source).parent_path();
  model = std::filesystem::absolute(folder / model).lexically_normal();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(model, ignored)) {
    node.fail("is " + model.string() + ": there is no such file");
  }
  file.replace(node, model.string());
  return file;
}

bool is_from_file(const File& file) { return detail::is_from_file(file.root()); }

AnyRobotConfig load_any_robot_config(const std::string& name,
                                     const std::vector<std::string>& overrides) {
  return read_any_robot_config(load_config_file(name, overrides));
}

AnyRobotConfig read_any_robot_config(const File& file) {
  if (detail::is_from_file(file.root())) return read_file_robot(file);
  return read_robot_config(file);
}

}  // namespace trifinger
