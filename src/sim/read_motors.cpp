// SPDX-License-Identifier: BSD-3-Clause
#include "read_motors.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/text_of.hpp"
#include "in_seconds.hpp"
#include "joint/counted_driver.hpp"
#include "servos/read_options.hpp"
#include "sim/boards_config.hpp"
#include "sim/servo_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger::detail {
namespace {

using config::Node;

// What a driver must know of this robot. `sensors` are joints that are measured without a motor.
CountedDriverOptions driver_options(const SimulationOptions& simulation, const SceneModel& model,
                                    const std::vector<std::string>& sensors = {}) {
  CountedDriverOptions options{.types = robot_types_of(simulation),
                               .names = model.joint_names(),
                               .limits = simulation.limits.value(),
                               .num_tips = model.tip_geoms().size(),
                               .stop = simulation.stop,
                               .period = simulation.period};
  const SceneModel::Data data = model.make_data();
  model.reset(*data);
  for (std::size_t i = 0; i < options.names.size(); ++i) {
    options.initial_position.push_back(
        simulation.initial_position ? (*simulation.initial_position)[i] : model.position(i, *data));
  }
  if (model.drives_all()) return options;
  std::vector<std::string> measured = options.names;
  measured.insert(measured.end(), sensors.begin(), sensors.end());
  for (const ModelJoint& joint : model.model_joints()) {
    const auto found = std::ranges::find(measured, joint.name);
    options.all_joints.push_back(found == measured.end() ? std::nullopt
                                                         : std::optional(static_cast<std::size_t>(
                                                               found - measured.begin())));
  }
  return options;
}

template <class Options>
void validate(const Options& options, const Node& section) {
  try {
    options.validate();
  } catch (const InvalidArgument& error) {
    section.fail(std::string("makes no sense: ") + error.what());
  }
}

// Joints that slide have no gear ratio, and boards know of no time between their messages.
void require_boards_fit(const Node& section, const SimulationOptions& simulation) {
  if (simulation.file == nullptr) return;
  for (const DrivenJoint& joint : simulation.file->joints()) {
    if (!joint.is_slide) continue;
    section.fail("cannot drive " + joint.name +
                 ": it slides, but a board measures how far its motor turns, and nothing says how "
                 "far the joint moves in a turn; boards are for joints that turn, so leave it out "
                 "of robot.joints, or run the robot on Dynamixel motors, whose ratio may be in "
                 "rad/m");
  }
  if (simulation.period % kPhysicsStep == Nanoseconds::zero()) return;
  section.fail(text_of("does not fit a period of ", in_seconds(simulation.period),
                       " s (backend.period): boards measure once a millisecond, so it must be a "
                       "whole number of milliseconds"));
}

servos::ServoConfig read_servos(const Node& root, const SimulationOptions& simulation) {
  const std::shared_ptr<const SceneModel> shared = make_model(simulation);
  const SceneModel& model = *shared;
  std::vector<std::string> all;
  for (const ModelJoint& joint : model.model_joints()) all.push_back(joint.name);
  servos::ServoConfig config = servos::read_servo_config(root, model.joint_names(), all);
  static_cast<CountedDriverOptions&>(config.robot) =
      driver_options(simulation, model, config.sensor_names);
  config.robot.weight = weight_of(shared);
  for (const std::string& name : config.sensor_names) {
    const mjModel& mujoco = *model.mujoco();
    const int joint = mj_name2id(&mujoco, mjOBJ_JOINT, name.c_str());
    auto& range = config.robot.sensor_ranges.emplace_back();
    if (mujoco.jnt_limited[joint]) {
      range = {mujoco.jnt_range[2 * joint], mujoco.jnt_range[2 * joint + 1]};
    }
  }
  validate(config.robot, root.section("dynamixel"));
  return config;
}

BoardsConfig read_boards(const Node& root, const SimulationOptions& simulation) {
  const Node section = root.section("boards");
  require_boards_fit(section, simulation);
  CountedDriverOptions robot = driver_options(simulation, *make_model(simulation));
  // The joints of a TriFinger are known by their numbers.
  if (simulation.file == nullptr) robot.names.assign(robot.names.size(), "");
  const boards::BusKind bus = boards::read_bus_kind(section);
  BoardsConfig config{.bus = bus, .options = boards::read_board_options(section, robot)};
  validate(config.options, section);
  return config;
}

}  // namespace

void read_motors(const Node& root, RobotConfig& config) {
  enum class Kind : std::uint8_t { kSimulation, kBoards, kServos };
  const auto kind = root.required_choice<Kind>(
      "driver",
      {{"simulation", Kind::kSimulation}, {"boards", Kind::kBoards}, {"dynamixel", Kind::kServos}});
  if (kind == Kind::kSimulation) {
    // A simulation may extend the configuration of a robot that has motors.
    for (const char* const motors : {"boards", "dynamixel"}) root.leave_out(motors);
    return;
  }
  // What hardware needs must not be guessed.
  static_cast<void>(root.section("backend"));
  if (kind == Kind::kBoards) {
    config.boards = std::make_shared<const BoardsConfig>(read_boards(root, config.simulation));
  } else {
    config.servos =
        std::make_shared<const servos::ServoConfig>(read_servos(root, config.simulation));
  }
}

}  // namespace trifinger::detail
