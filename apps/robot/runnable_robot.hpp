// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {

// Everything that a back-end needs.
struct RunnableRobot {
  std::string name;  // name of its session
  std::unique_ptr<UntypedDriver> driver;
  BackendOptions backend;
  SessionOptions session;
  bool needs_real_time{false};
  // Returns the state before the simulation diverged, if that is the `fault`; otherwise an empty
  // state. Call this only while nobody uses the driver.
  std::function<SimulationState(const Fault& fault)> state_before{
      [](const Fault&) { return SimulationState(); }};
  // Returns what a user should know and has happened since the last call, in sentences.
  std::function<std::vector<std::string>()> news{[] { return std::vector<std::string>(); }};
};

// Makes the robot that is called `robot` on the command line: "fake", the name or the path of a
// configuration, or a log to be played. `name` replaces its own name. `overrides` are settings such
// as "fingers.height=0.3". A simulation begins in the state saved in the file `state`. Throws
// ConfigError, InvalidArgument, SystemError.
[[nodiscard]] RunnableRobot make_robot(const std::string& robot,
                                       const std::optional<std::string>& name,
                                       const std::vector<std::string>& overrides,
                                       const std::optional<std::filesystem::path>& state);

}  // namespace trifinger::apps
