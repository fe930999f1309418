// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "trifinger/core/session.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::guiding {

/// What a guide must know of its robot. Values of joints are for the first `num_joints` joints.
struct GuidedRobot {
  RobotDescription description{};
  /// The limits of the robot's safety checks.
  std::array<JointLimit, kMaxJoints> limits{};
  /// Where `home` leads [rad].
  JointValues home{};
};

/// The robot with the limits and the initial pose of its variant.
[[nodiscard]] GuidedRobot guided_robot(const RobotDescription& description);

/// The robot of `session`, from the configuration that its back-end has used.
/// @throws InvalidArgument if the session has no configuration, config::ConfigError
[[nodiscard]] GuidedRobot guided_robot(const Session& session);

}  // namespace trifinger::guiding
