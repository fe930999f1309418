// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/boards/board_robot.hpp"
#include "trifinger/manipulation/report.hpp"
#include "trifinger/manipulation/task.hpp"
#include "trifinger/rendering/options.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::evaluation {

// A force on the object's centre while it is held.
struct Push {
  Eigen::Vector3d force;        // [N]
  control::Seconds after{5.0};  // After the beginning of the hold.
  control::Seconds duration{0.05};
};

// One manipulation in a simulation of its own. The controller believes that robot and object are
// like `believed`; the simulation may have another mass and friction.
struct Trial {
  SimulationOptions<TriFinger> simulation;
  RobotDescription believed;
  manipulation::ManipulationConfig config;
  std::optional<Push> push;
  // The robot has emulated motor boards, which drive the simulation.
  std::optional<boards::BoardRobotOptions<TriFinger>> boards{};
  // The robot knows its objects only from the images of its cameras.
  struct Sight {
    RobotConfig config;
    rendering::RenderingOptions rendering{};
  };
  std::optional<Sight> sight{};
};

// Makes a trial from the configurations of a robot and of a manipulation, without any variation.
// Both are given by name; see `load_robot_config` and `manipulation::load_config`. If the robot is
// on motor boards, these are emulated.
[[nodiscard]] Trial make_trial(const std::string& robot, const std::vector<std::string>& settings,
                               const std::string& manipulation, const std::string& task,
                               const std::vector<std::string>& manipulation_settings = {});

// Returns `trial` with everything varied that is not known in advance: where the cube lies (within
// 3 cm, any yaw), its mass (within 20 %), the friction of the tips (0.6 to 1.0), the delay of its
// poses (10 to 30 ms) and their noise (1 mm, 0.5 degrees). A robot with cameras has these instead
// of poses: with other light, colours, dust, noise, and a calibration that is 0.5 pixels off.
[[nodiscard]] Trial varied(const Trial& trial, std::uint64_t seed);

// Returns a push of 1 N from a side that depends on the seed.
[[nodiscard]] Push push_from_any_side(std::uint64_t seed);

struct TrialResult {
  manipulation::Trace trace;
  // True poses of the object, used only for the report.
  std::vector<manipulation::SeenPose> truth;
  manipulation::Report report;
};

[[nodiscard]] TrialResult run_trial(const Trial& trial);

}  // namespace trifinger::evaluation
