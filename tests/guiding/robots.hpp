// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "guiding/joint_elements.hpp"
#include "model/file_robots.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/guiding/guide_controller.hpp"
#include "trifinger/guiding/guided_robot.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {

/// An arm whose seven joints turn about two axes in turn. Its two frames share joints.
inline constexpr const char* kSevenJoints = R"(<mujoco model="seven">
  <compiler angle="radian"/>
  <default><joint damping="0.2" frictionloss="0.05" armature="0.02" range="-2.6 2.6"/><geom density="300" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="b1" pos="0 0 0.3"><joint name="j1" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.03"/>
    <body name="b2" pos="0 0 0.1"><joint name="j2" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.15" size="0.03"/>
    <body name="b3" pos="0 0 0.15"><joint name="j3" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.03"/>
    <body name="b4" pos="0 0 0.1"><joint name="j4" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.15" size="0.02"/>
    <body name="b5" pos="0 0 0.15"><joint name="j5" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.02"/>
    <body name="b6" pos="0 0 0.1"><joint name="j6" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.02"/>
    <body name="b7" pos="0 0 0.1"><joint name="j7" axis="1 0 0"/><geom type="capsule" fromto="0 0 0 0 0 0.05" size="0.02"/>
      <site name="hand" pos="0 0 0.08"/>
    </body></body></body></body></body></body></body>
  </worldbody>
</mujoco>
)";

/// One slide, across gravity and a little up, with friction.
inline constexpr const char* kOneSlide = R"(<mujoco model="slide">
  <compiler angle="radian"/>
  <worldbody>
    <body name="cart"><joint name="rail" type="slide" axis="1 0 0.5" damping="3" frictionloss="0.5" armature="0.5" range="-1 1"/>
      <geom type="box" size="0.05 0.05 0.05" mass="1"/><site name="cart"/></body>
  </worldbody>
</mujoco>
)";

/// One hinge: a pendulum.
inline constexpr const char* kOneHinge = R"(<mujoco model="pendulum">
  <compiler angle="radian"/>
  <worldbody>
    <body name="rod" pos="0 0 1"><joint name="pivot" axis="0 1 0" damping="0.05" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/><site name="end" pos="0 0 -0.3"/></body>
  </worldbody>
</mujoco>
)";

inline SimulationOptions options_of_file(const char* model, const std::string& more) {
  const Folder folder;
  write(folder / "robot.xml", model);
  write(folder / "robot.yml", "name: file\ndriver: simulation\nrobot:\n  mjcf: robot.xml\n" + more);
  return load_robot_config((folder / "robot.yml").string()).simulation;
}

/// The names of the robots of these tests.
inline constexpr std::array kGuidedRobots{"trifinger", "finger",      "pendulum",
                                          "slide",     "four_joints", "seven_joints"};

/// A robot without a table or objects in its way.
inline SimulationOptions guided_options(std::string_view name) {
  SimulationOptions options;
  options.description.objects.clear();
  // Pro has the tightest limits.
  options.description.variant = Variant::kPro;
  if (name == "finger") options.description.arrangement = Arrangement::kSingleFinger;
  if (name == "four_joints") return options_of_file(kArm, kArmSafety);
  if (name == "pendulum") {
    return options_of_file(kOneHinge,
                           "safety:\n  pivot: {max_torque: 5, safety_kd: 0.05, soft_lower: -.inf, "
                           "soft_upper: .inf, max_velocity: 6, braking: 20, default_kp: 20, "
                           "default_kd: 0.6}\n");
  }
  if (name == "slide") {
    return options_of_file(kOneSlide,
                           "safety:\n  rail: {max_torque: 60, safety_kd: 2, soft_lower: -0.8, "
                           "soft_upper: 0.8, max_velocity: 1, braking: 3, default_kp: 500, "
                           "default_kd: 40}\n");
  }
  if (name == "seven_joints") {
    return options_of_file(
        kSevenJoints,
        "  initial_position: {j2: 0.5, j4: 1.0, j6: 0.6, j7: 0.2}\n"
        "safety:\n  every_joint: {max_torque: 30, safety_kd: 0.2, soft_lower: -2.3, soft_upper: "
        "2.3, max_velocity: 3, braking: 10, default_kp: 60, default_kd: 3}\n");
  }
  return options;
}

inline guiding::GuidedRobot guided(std::string_view name) {
  std::vector<std::string> frames;
  if (name == "four_joints") frames = {"near"};
  if (name == "seven_joints") frames = {"hand", "b5"};
  return guiding::guided_robot(guided_options(name), frames);
}

/// How far the first frame of a robot can move on a line from its initial pose [m]; nothing if it
/// moves on no line.
inline std::optional<Eigen::Vector3d> line_of(std::string_view name) {
  if (name == "pendulum") return std::nullopt;
  if (name == "slide") return Eigen::Vector3d(0.1, 0.0, 0.05);
  if (name == "four_joints") return Eigen::Vector3d(0.05, 0.0, 0.05);  // in its plane
  return Eigen::Vector3d(0.02, -0.02, 0.05);
}

inline double period_of(const SimulationOptions& options) {
  return std::chrono::duration<double>(options.period).count();
}

/// The robot in a simulation, driven step by step by a controller.
class GuidedSimulation {
 public:
  explicit GuidedSimulation(std::string_view name,
                            const std::optional<std::vector<double>>& begin = {},
                            const guiding::GuideSpeeds& speeds = {})
      : robot(guided_options(name)),
        backend(robot, host, {.period = robot.options().period}),
        controller(guided(name), speeds, robot.options().period) {
    if (begin) robot.reset(*begin, Random{1});
    frontend.emplace(backend);
    elements.emplace(frontend->session());
    frontend->latest_observation(elements->observation(), kForever);
    EXPECT_TRUE(controller.begin(elements->measured()));
  }

  [[nodiscard]] const guiding::MeasuredJoints& measured() { return elements->measured(); }
  void step() {
    command = controller.update(elements->measured());
    time = frontend->append_desired_action(elements->action(command), kForever);
    frontend->get(Series::kObservation, time, elements->observation(), kForever);
  }
  /// Does steps until the robot has arrived. Returns false if it has not after `most` steps.
  [[nodiscard]] bool arrive(int most = 20000) {
    for (int i = 0; i < most; ++i) {
      step();
      if (controller.state().has_arrived) return true;
    }
    return false;
  }

  SimulatedRobot robot;
  SessionHost host{SessionHost::anonymous()};
  Backend backend;
  std::optional<UntypedFrontend> frontend;
  std::optional<guiding::detail::JointElements> elements;
  guiding::GuideController controller;
  guiding::GuideCommand command{};
  TimeIndex time{-1};
};

}  // namespace trifinger::test
