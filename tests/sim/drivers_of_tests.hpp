// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>
#include <string_view>
#include <tuple>

#include "model/file_robots.hpp"
#include "support/folder.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {

template <class R>
SimulationOptions options_of_tests() {
  SimulationOptions options;
  if constexpr (R::kTips == 1) options.description.arrangement = Arrangement::kSingleFinger;
  options.object_period = 4;
  options.object_delay = 2;
  options.object_position_noise = 1e-3;
  return options;
}

template <class R>
struct SimulatedRobotTraits {
  static constexpr std::string_view kName =
      R::kTips == 1 ? "SimulatedFinger" : "SimulatedTriFinger";
  using Robot = R;

  static std::unique_ptr<UntypedDriver> make_driver() {
    return std::make_unique<SimulatedRobot>(options_of_tests<R>());
  }
  static typename R::Action action(TimeIndex k) {
    typename R::Action action;
    for (std::size_t joint = 0; joint < R::kJoints; ++joint) {
      action.torque[joint] =
          0.2 * std::sin(static_cast<double>(k + 1) + static_cast<double>(joint));
    }
    return action;
  }
};

/// The robot of file_robots.hpp with a rail that nobody drives, as a program in C++ sees it.
struct ArmOfFile : JointRobot<3> {
  static constexpr std::string_view kType = "some_arm";

  struct Observation {
    JointVector<3> position{};
    JointVector<3> velocity{};
    JointVector<3> torque{};
    JointVector<6> joint_position{};
    JointVector<6> joint_velocity{};

    static constexpr auto fields() {
      return std::tuple{field("position", &Observation::position, "rad"),
                        field("velocity", &Observation::velocity, "rad/s"),
                        field("torque", &Observation::torque, "Nm"),
                        field("joint_position", &Observation::joint_position, "rad or m"),
                        field("joint_velocity", &Observation::joint_velocity, "rad/s or m/s")};
    }
  };
};

struct FileRobotTraits {
  static constexpr std::string_view kName = "RobotFromFile";
  using Robot = ArmOfFile;

  static std::unique_ptr<UntypedDriver> make_driver() {
    static const SimulationOptions options = [] {
      const Folder folder;
      write(folder / "arm.xml", kArm);
      write(folder / "arm.yml", R"(name: arm
driver: simulation
robot: {mjcf: arm.xml, joints: [shoulder, elbow, finger]}
safety:
  every_joint: {safety_kd: 0.3, max_velocity: 3, braking: 4, default_kp: 20, default_kd: 1}
  shoulder: {soft_lower: -1.8, soft_upper: 1.8}
  elbow: {soft_lower: -2.2, soft_upper: 2.2}
  finger: {soft_lower: 0.1, soft_upper: 1.4, safety_kd: 0.1}
simulation: {object_period: 0.008, object_delay: 0.004, object_position_noise: 0.001}
)");
      return load_robot_config((folder / "arm.yml").string()).simulation;
    }();
    return std::make_unique<SimulatedRobot>(options);
  }
  static ArmOfFile::Action action(TimeIndex k) {
    ArmOfFile::Action action;
    for (std::size_t joint = 0; joint < ArmOfFile::kJoints; ++joint) {
      action.torque[joint] =
          0.2 * std::sin(static_cast<double>(k + 1) + static_cast<double>(joint));
    }
    return action;
  }
};

}  // namespace trifinger::test
