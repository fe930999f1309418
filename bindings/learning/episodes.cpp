// SPDX-License-Identifier: BSD-3-Clause
#include "episodes.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>
#include <variant>

#include "conversion/timeout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/rendering/simulation_that_sees.hpp"
#include "trifinger/sim/robot_cameras.hpp"

namespace trifinger::bindings {
namespace {

using namespace learning;

Nanoseconds period_of(const RobotConfig& config) {
  return std::visit([](const auto& options) { return options.period; }, config.simulation);
}

Nanoseconds period_of(const AnyRobotConfig& config) {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return file->robot.model->period();
  }
  return period_of(std::get<RobotConfig>(config));
}

Environment make_environment(const TaskDescription& task, const EnvironmentOptions& options,
                             const AnyRobotConfig& config) {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return {task, options, file->robot};
  }
  const auto& robot = std::get<RobotConfig>(config);
  return {task, options, description_of(robot), period_of(robot)};
}

// Age of the newest pose just before the next one arrives; `is_elsewhere`: of a robot in another
// process, whose poses may be a little late [steps].
TimeIndex oldest_sure_age_of(const AnyRobotConfig& config, bool is_elsewhere) {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return (is_elsewhere ? 2 : 1) * file->robot.object_period - 1;
  }
  const auto& robot = std::get<RobotConfig>(config);
  return is_elsewhere ? rendering::oldest_sure_age_elsewhere(robot)
                      : rendering::oldest_sure_age(robot);
}

// What a configuration names as the files of its robot, none of which is opened.
std::vector<std::string> files_of(const config::File& file) {
  std::vector<std::string> files;
  if (!is_from_file(file)) return files;
  const config::Node robot = file.root().section("robot");
  for (const char* key : {"mjcf", "urdf", "mesh_folder"}) {
    const auto node = robot.find(key);
    files.push_back(node ? node->as<std::string>() : "");
  }
  return files;
}

// Reads the configuration of a robot that anybody may have started: only files that `expected`
// names too are opened.
AnyRobotConfig read_foreign_config(const std::string& text, const AnyRobotConfig& expected) {
  const auto file = config::File::parse(text, "configuration.yml");
  const auto& session = std::visit(
      [](const auto& robot) -> const SessionOptions& { return robot.session; }, expected);
  const auto own = config::File::parse(session.documents.at(0).text, "configuration.yml");
  const std::vector<std::string> files = files_of(file);
  if (!files.empty() && files != files_of(own)) {
    throw InvalidArgument("the robot is a '" + file.root().required<std::string>("name") +
                          "' made of " + files[0] + files[1] +
                          ", which is not the file that `config` names");
  }
  return read_any_robot_config(file);
}

// Throws InvalidArgument if `actual` is another robot than `expected`.
void check_same_robot(const AnyRobotConfig& actual, const AnyRobotConfig& expected) {
  const auto is_same = [&] {
    if (actual.index() != expected.index()) return false;
    if (const auto* const file = std::get_if<FileRobotConfig>(&actual)) {
      const auto names_of = [](const FileRobotConfig& config) {
        std::vector<std::string> names;
        for (const FileJoint& joint : config.robot.model->joints()) names.push_back(joint.name);
        return names;
      };
      return names_of(*file) == names_of(std::get<FileRobotConfig>(expected));
    }
    const RobotDescription description = description_of(std::get<RobotConfig>(actual));
    const RobotDescription wanted = description_of(std::get<RobotConfig>(expected));
    return description.variant == wanted.variant && description.arrangement == wanted.arrangement;
  };
  if (!is_same()) {
    throw InvalidArgument("the robot is a '" +
                          std::visit([](const auto& robot) { return robot.name; }, actual) +
                          "', which is not what `config` says");
  }
  if (period_of(actual) != period_of(expected)) {
    throw InvalidArgument("the robot's period is " + std::to_string(to_seconds(period_of(actual))) +
                          " s, `config` says " + std::to_string(to_seconds(period_of(expected))) +
                          " s");
  }
}

// The cameras that an environment with these options observes.
std::vector<camera::Camera> observed_cameras(const EnvironmentOptions& options,
                                             const AnyRobotConfig& config) {
  if (options.layout != Layout::kImages) return {};
  const auto* const robot = std::get_if<RobotConfig>(&config);
  if (robot == nullptr) return {};  // The environment refuses the layout.
  return camera_calibration(*robot, robot->name).cameras;
}

// The field `name` of an element, which has so many numbers.
const FieldDescription& field_of(const ElementDescription& type, std::string_view name,
                                 std::size_t count) {
  const FieldDescription* const field = type.find(name);
  if (field != nullptr && field->type == ScalarType::kFloat64 && field->count() == count) {
    return *field;
  }
  throw InvalidArgument("this robot has no field '" + std::string(name) + "' of " +
                        std::to_string(count) + " numbers: it is not what `config` says");
}

template <std::size_t N>
void read(const ElementDescription& type, std::span<const std::byte> element, std::string_view name,
          std::array<double, N>& numbers, std::size_t count) {
  std::memcpy(numbers.data(), element.data() + field_of(type, name, count).offset,
              count * sizeof(double));
}

ObjectPose read_pose(const ElementDescription& type, std::span<const std::byte> element,
                     const std::string& name) {
  ObjectPose pose;
  read(type, element, name + ".position", pose.position, 3);
  read(type, element, name + ".orientation", pose.orientation, 4);
  return pose;
}

}  // namespace

Episodes::Episodes(const TaskDescription& task, const EnvironmentOptions& options,
                   AnyRobotConfig its_config)
    : environment(make_environment(task, options, its_config)),
      config(std::move(its_config)),
      oldest_sure_age(oldest_sure_age_of(config, /*is_elsewhere=*/false)),
      cameras(observed_cameras(options, config)),
      observation(environment.observation_size()),
      achieved(environment.goal_size()),
      desired(environment.goal_size()) {}

void Episodes::begin(std::uint64_t seed, std::uint64_t number) {
  const Beginning one{.seed = seed, .number = number, .episode = &episode, .start = &start};
  environment.begin({&one, 1});
}

std::vector<double> Episodes::model_positions() const {
  const auto* const file = std::get_if<FileRobotConfig>(&config);
  if (file == nullptr) return {};
  const std::size_t joints =
      std::min(file->robot.model->model_joints().size(), start.model_position.size());
  return {start.model_position.begin(),
          start.model_position.begin() + static_cast<std::ptrdiff_t>(joints)};
}

void Episodes::check_robot(const std::optional<std::string>& actual) {
  const AnyRobotConfig robot = actual ? read_foreign_config(*actual, config) : config;
  check_same_robot(robot, config);
  oldest_sure_age = oldest_sure_age_of(robot, /*is_elsewhere=*/true);
}

Episodes::Seen Episodes::step(PythonFrontend& robot, std::span<const float> numbers,
                              const PythonFrontend* poses, const PythonSimulation* simulation) {
  // First of all: who is refused has changed nothing.
  const PythonFrontend::Turn turn(robot);
  const std::size_t joints = environment.num_joints();
  if (numbers.size() != joints) {
    throw InvalidArgument("an action must be an array of " + std::to_string(joints) + " numbers");
  }
  std::array<double, kMaxCountedJoints> torque;    // NOLINT(*-member-init)
  std::array<double, kMaxCountedJoints> position;  // NOLINT(*-member-init)
  if (!environment.take_action(numbers, episode, {torque.data(), joints},
                               {position.data(), joints})) {
    throw InvalidArgument("an action must be finite");
  }
  const RobotTypes& types = turn.session().description();
  const std::size_t size = types.default_action.size();
  const auto count = static_cast<std::size_t>(environment.options().steps_per_action);
  burst_.resize(count * size);
  std::ranges::copy(types.default_action, burst_.begin());
  for (const auto& [name, values] : {std::pair("torque", &torque), {"position", &position}}) {
    std::memcpy(burst_.data() + field_of(types.action, name, joints).offset, values->data(),
                joints * sizeof(double));
  }
  for (std::size_t i = 1; i < count; ++i) {
    std::copy_n(burst_.begin(), size, burst_.begin() + static_cast<std::ptrdiff_t>(i * size));
  }
  element_.resize(types.observation.size());
  // Which observation follows an action: docs/learning.md.
  const bool is_first = environment.options().mapping == Mapping::kStateAugmentation;
  last_step = turn.act(burst_.data(), count, is_first, element_.data());
  return judge(types.observation, element_, last_step, poses, simulation);
}

Episodes::Seen Episodes::look(PythonFrontend& robot, TimeIndex t, const PythonFrontend* poses,
                              const PythonSimulation* simulation) {
  const PythonFrontend::Held held(robot);
  const ElementDescription& type = held.session().description().observation;
  element_.resize(type.size());
  held.copy(t, element_.data());
  return judge(type, element_, t, poses, simulation);
}

Episodes::Seen Episodes::judge(const ElementDescription& type, std::span<const std::byte> element,
                               TimeIndex t, const PythonFrontend* poses,
                               const PythonSimulation* simulation) {
  const std::size_t joints = environment.num_joints();
  const std::string object(environment.object_name());
  using Joints = std::array<double, kMaxCountedJoints>;
  Joints position;                                                 // NOLINT(*-member-init)
  Joints velocity;                                                 // NOLINT(*-member-init)
  Joints torque;                                                   // NOLINT(*-member-init)
  std::array<double, FileBody::kMaxConfiguration> model_position;  // NOLINT(*-member-init)
  std::array<double, FileBody::kMaxConfiguration> model_velocity;  // NOLINT(*-member-init)
  read(type, element, "position", position, joints);
  read(type, element, "velocity", velocity, joints);
  Measurement measurement{.position = std::span(position).first(joints),
                          .velocity = std::span(velocity).first(joints)};
  Seen seen{.time_index = t};

  std::vector<std::byte> objects;
  std::optional<PythonFrontend::Held> held;
  const ElementDescription* objects_type = nullptr;
  if (poses != nullptr) {
    held.emplace(*poses);
    objects_type = &held->session().element(Series::kObservation);
    objects.resize(objects_type->size());
    if (!held->copy_latest_at(t, objects.data())) objects.clear();
  }
  ObjectPose pose;
  ObjectPose truth;
  if (!object.empty()) {
    measurement.object = &pose;
    if (!objects.empty()) {
      pose = read_pose(*objects_type, objects, object);
      TimeIndex captured = 0;
      const FieldDescription* const stamp = objects_type->find("stamp.capture_index");
      std::memcpy(&captured, objects.data() + stamp->offset, sizeof(captured));
      seen.object_age = t - captured;
    } else if (environment.options().object_poses != ObjectPoses::kTracked) {
      throw InvalidArgument("nobody has said where the " + object + " is");
    }
    if (simulation != nullptr && environment.judges_by_truth()) {
      truth = simulation->observed_object_pose(object);
      measurement.true_object = &truth;
    }
  }
  std::vector<ObjectPose> bodies;
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    const ModelFile& model = *file->robot.model;
    read(type, element, "torque", torque, joints);
    measurement.torque = std::span(torque).first(joints);
    if (!model.drives_all()) {
      const std::size_t count = model.model_joints().size();
      read(type, element, "joint_position", model_position, count);
      read(type, element, "joint_velocity", model_velocity, count);
      measurement.model_position = std::span(model_position).first(count);
      measurement.model_velocity = std::span(model_velocity).first(count);
    }
    for (const ObjectAddress& body : model.free_bodies()) {
      if (objects.empty()) throw InvalidArgument("nobody has said where the " + body.name + " is");
      bodies.push_back(read_pose(*objects_type, objects, body.name));
    }
    measurement.bodies = bodies;
  }
  Observed one;
  one.measurement = measurement;
  one.episode = &episode;
  one.observation = observation;
  one.achieved = achieved;
  one.desired = desired;
  environment.observe({&one, 1});
  outcome = one.outcome;
  return seen;
}

}  // namespace trifinger::bindings
