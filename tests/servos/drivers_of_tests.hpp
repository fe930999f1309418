// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>
#include <string_view>

#include "servos/rig.hpp"

namespace trifinger::servos::test {

struct ServoRobotTraits {
  static constexpr std::string_view kName = "ServoRobot";
  using Robot = Claw;

  static std::unique_ptr<UntypedDriver> make_driver() {
    RigOptions options{.robot = claw_options()};
    return std::make_unique<ServoRobot>(options.robot, std::make_unique<RigMotors>(options));
  }
  static Claw::Action action(TimeIndex k) {
    Claw::Action action;
    for (std::size_t joint = 0; joint < kJoints; ++joint) {
      action.torque[joint] =
          0.05 * std::sin(static_cast<double>(k + 1) + static_cast<double>(joint));
    }
    return action;
  }
};

}  // namespace trifinger::servos::test
