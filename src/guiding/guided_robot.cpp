// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guided_robot.hpp"

#include <algorithm>
#include <cstddef>

#include "servos/read_options.hpp"
#include "trifinger/model/frames.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::guiding {

GuidedRobot guided_robot(const SimulationOptions& options, std::span<const std::string> frames) {
  SimulationOptions bare = options;
  bare.description.objects.clear();
  GuidedRobot robot{.model = make_model(bare),
                    .limits = options.limits.value_or(std::vector<JointLimit>{}),
                    .home = {},
                    .frames = {frames.begin(), frames.end()}};
  if (robot.limits.empty()) robot.limits = default_limits(options.description);
  if (frames.empty()) {
    robot.frames = end_frames(*robot.model);
    if (robot.frames.size() > kMaxGuidedFrames) robot.frames.resize(kMaxGuidedFrames);
  }
  if (options.file == nullptr) robot.description = bare.description;
  const SceneModel::Data start = robot.model->make_data();
  robot.model->reset(*start);
  robot.home.resize(std::ssize(robot.limits));
  for (std::size_t i = 0; i < robot.limits.size(); ++i) {
    const double position = options.initial_position ? options.initial_position->at(i)
                                                     : robot.model->position(i, *start);
    robot.home[static_cast<Eigen::Index>(i)] =
        std::clamp(position, robot.limits[i].soft_lower, robot.limits[i].soft_upper);
  }
  return robot;
}

GuidedRobot guided_robot(const Session& session, std::span<const std::string> frames) {
  const RobotConfig config = read_robot_config(config_file_of(session));
  GuidedRobot robot = guided_robot(config.simulation, frames);
  robot.refuses_torques =
      config.servos != nullptr && config.servos->robot.mode == servos::ServoMode::kPosition;
  return robot;
}

}  // namespace trifinger::guiding
