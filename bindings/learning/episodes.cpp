// SPDX-License-Identifier: BSD-3-Clause
#include "episodes.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "conversion/timeout.hpp"
#include "sim/robot_cameras.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"

namespace trifinger::bindings {
namespace {

using namespace learning;

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
RobotConfig read_foreign_config(const std::string& text, const RobotConfig& expected) {
  const auto file = config::File::parse(text, "configuration.yml");
  const auto own = config::File::parse(expected.session.documents.at(0).text, "configuration.yml");
  const std::vector<std::string> files = files_of(file);
  if (!files.empty() && files != files_of(own)) {
    throw InvalidArgument("the robot is a '" + file.root().required<std::string>("name") +
                          "' made of " + files[0] + files[1] +
                          ", which is not the file that `config` names");
  }
  return read_robot_config(file);
}

// Throws InvalidArgument if `actual` is another robot than `expected`.
void check_same_robot(const RobotConfig& actual, const RobotConfig& expected) {
  const SimulationOptions& robot = actual.simulation;
  const SimulationOptions& wanted = expected.simulation;
  const auto is_same = [&] {
    if (robot.file != nullptr && wanted.file != nullptr) {
      return robot.file->joint_names() == wanted.file->joint_names();
    }
    return robot.file == wanted.file && robot.description.variant == wanted.description.variant &&
           robot.description.arrangement == wanted.description.arrangement;
  };
  if (!is_same()) {
    throw InvalidArgument("the robot is a '" + actual.name + "', which is not what `config` says");
  }
  if (robot.period != wanted.period) {
    throw InvalidArgument("the robot's period is " + std::to_string(to_seconds(robot.period)) +
                          " s, `config` says " + std::to_string(to_seconds(wanted.period)) + " s");
  }
}

// The cameras that an environment with these options observes.
std::vector<camera::Camera> observed_cameras(const EnvironmentOptions& options,
                                             const RobotConfig& config) {
  if (options.layout != Layout::kImages) return {};
  return camera_calibration(config, config.name).cameras;
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
                   RobotConfig its_config)
    : environment(task, options, its_config.simulation),
      config(std::move(its_config)),
      oldest_sure_age(rendering::oldest_sure_age(config)),
      cameras(observed_cameras(options, config)),
      observation(environment.observation_size()),
      achieved(environment.goal_size()),
      desired(environment.goal_size()) {}

void Episodes::begin(std::uint64_t seed, std::uint64_t number) {
  const Beginning one{.seed = seed, .number = number, .episode = &episode, .start = &start};
  environment.begin({&one, 1});
}

std::vector<double> Episodes::model_positions() const {
  const ModelFile* const model = config.simulation.file.get();
  if (model == nullptr) return {};
  const std::size_t joints = std::min(model->model_joints().size(), start.model_position.size());
  return {start.model_position.begin(),
          start.model_position.begin() + static_cast<std::ptrdiff_t>(joints)};
}

void Episodes::check_robot(const std::optional<std::string>& actual) {
  const RobotConfig robot = actual ? read_foreign_config(*actual, config) : config;
  check_same_robot(robot, config);
  oldest_sure_age = rendering::oldest_sure_age_elsewhere(robot);
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
  std::array<double, kMaxCountedJoints> kp;  // NOLINT(*-member-init)
  kp.fill(environment.position_kp());
  for (const auto& [name, values] :
       {std::pair("torque", &torque), {"position", &position}, {"position_kp", &kp}}) {
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
  read(type, element, "torque", torque, joints);
  measurement.torque = std::span(torque).first(joints);
  if (config.simulation.file != nullptr) {
    const ModelFile& model = *config.simulation.file;
    if (!model.drives_all()) {
      const std::size_t count = model.model_joints().size();
      read(type, element, "joint_position", model_position, count);
      read(type, element, "joint_velocity", model_velocity, count);
      measurement.model_position = std::span(model_position).first(count);
      measurement.model_velocity = std::span(model_velocity).first(count);
    }
    for (const ObjectAddress& body : model.objects()) {
      // A tracker may not have found anything yet.
      if (objects.empty() && !config.tracks_objects) {
        throw InvalidArgument("nobody has said where the " + body.name + " is");
      }
      bodies.push_back(objects.empty() ? ObjectPose{}
                                       : read_pose(*objects_type, objects, body.name));
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
