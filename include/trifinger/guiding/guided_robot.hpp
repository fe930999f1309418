// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/core/session.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::guiding {

/// The most frames that a guide may move.
inline constexpr int kMaxGuidedFrames = 8;

/// One number per driven joint. They are stored in place, never on the heap. Numbers of a joint
/// that slides have m in the place of rad and N in that of Nm.
using GuidedJoints =
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, static_cast<int>(kMaxCountedJoints), 1>;
/// One point per frame in the world frame [m]: a column each.
using FramePoints = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxGuidedFrames>;

/// What a guide must know of its robot.
struct GuidedRobot {
  std::shared_ptr<const SceneModel> model;
  /// The limits of the robot's safety checks, one for each driven joint.
  std::vector<JointLimit> limits{};
  /// Where `home` leads [rad], [m].
  GuidedJoints home{};
  /// The frames whose points can be moved: names as for `Frames`, at most `kMaxGuidedFrames`.
  std::vector<std::string> frames{};
  /// The description of a TriFinger, from which its model is made. With it the tip of a finger gets
  /// to every point that it can reach, in whatever posture.
  std::optional<RobotDescription> description{};
  /// Its motors follow positions by themselves and refuse torques (`dynamixel.mode: position` in
  /// its configuration, also in a simulation of it), so it cannot float.
  bool refuses_torques{false};
};

/// The robot of a simulation with these options. `home` is its initial pose. Without `frames` these
/// are its `end_frames`.
/// @throws InvalidArgument if the description cannot be built
[[nodiscard]] GuidedRobot guided_robot(const SimulationOptions& options,
                                       std::span<const std::string> frames = {});

/// The robot of `session`, from the configuration that its back-end has used. If the robot is from
/// a file, the file is read where the configuration says.
/// @throws InvalidArgument if the session has no configuration, config::ConfigError
[[nodiscard]] GuidedRobot guided_robot(const Session& session,
                                       std::span<const std::string> frames = {});

}  // namespace trifinger::guiding
