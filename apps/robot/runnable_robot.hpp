// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {

// Everything that a back-end needs.
struct RunnableRobot {
  std::string name;               // name of its session
  std::shared_ptr<void> owned{};  // what `driver` uses
  std::unique_ptr<UntypedDriver> driver;
  BackendOptions backend;
  SessionOptions session;
  bool needs_real_time{false};
  std::string calibration;              // a sentence about it; empty for a robot that needs none
  std::vector<std::string> warnings{};  // about its configuration, in sentences
  boards::BoardRobot* boards{nullptr};  // a part of `driver`, if it is on motor boards
  // Programs that should run beside it, as words after `trifinger`: its cameras.
  std::vector<std::vector<std::string>> sensor_programs{};
  // Returns the state before the simulation diverged, if that is the `fault`; otherwise an empty
  // state. Call this only while nobody uses the driver.
  std::function<SimulationState(const Fault& fault)> state_before{
      [](const Fault&) { return SimulationState(); }};
  // Returns what a user should know and has happened since the last call, in sentences.
  std::function<std::vector<std::string>()> messages{[] { return std::vector<std::string>(); }};
};

// A robot as it is called on the command line.
struct RobotChoice {
  std::string robot;  // "fake", the name or the path of a configuration, or a log to be played
  std::optional<std::string> name{};             // replaces its own name
  std::vector<std::string> overrides{};          // settings such as "fingers.height=0.3"
  std::optional<std::filesystem::path> state{};  // a saved state in which a simulation begins
  std::optional<BackendOptions::Mode> mode{};    // replaces that of its configuration
  bool is_calibrated{true};                      // its calibration counts, if there is one
};

// Throws ConfigError, InvalidArgument, SystemError.
[[nodiscard]] RunnableRobot make_robot(const RobotChoice& choice);

}  // namespace trifinger::apps
