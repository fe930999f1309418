// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/file_body.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::learning {

// What is known of each joint of a robot, one number per joint.
struct JointFigures {
  std::vector<double> initial{};  // Where it begins [rad], [m].
  std::vector<double> low{};      // What actions can ask for.
  std::vector<double> high{};
  std::vector<double> hard_low{};  // Where the joint can be.
  std::vector<double> hard_high{};
  std::vector<double> max_torque{};  // [Nm], [N]
  std::vector<double> kp{};          // of a position that comes without its own [Nm/rad], [N/m]
  Entry position{.name = "joint_position", .unit = "rad", .low = {}, .high = {}};  // observed
  Entry velocity{.name = "joint_velocity", .unit = "rad/s", .low = {}, .high = {}};
};

[[nodiscard]] JointFigures figures_of(const Kinematics& kinematics);
[[nodiscard]] JointFigures figures_of(const FileBody& body);

}  // namespace trifinger::learning
