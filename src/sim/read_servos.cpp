// SPDX-License-Identifier: BSD-3-Clause
#include "read_servos.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sim/servo_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger::detail {

servos::ServoConfig read_servos(const config::Node& root, const SimulationOptions& simulation) {
  const std::shared_ptr<const SceneModel> shared = make_model(simulation);
  const SceneModel& model = *shared;
  const std::vector<std::string> joints = model.joint_names();
  std::vector<std::string> all;
  for (const ModelJoint& joint : model.model_joints()) all.push_back(joint.name);
  servos::ServoConfig config = servos::read_servo_config(root, joints, all);
  config.robot.types = robot_types_of(simulation);
  config.robot.limits = *simulation.limits;
  config.robot.period = simulation.period;
  config.robot.stop = simulation.stop;
  config.robot.weight = weight_of(shared);
  const SceneModel::Data data = model.make_data();
  model.reset(*data);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    config.robot.initial_position.push_back(
        simulation.initial_position ? (*simulation.initial_position)[i] : model.position(i, *data));
  }
  config.robot.num_tips = model.tip_geoms().size();
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

}  // namespace trifinger::detail
