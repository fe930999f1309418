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

// All that a back-end is made of.
struct RunnableRobot {
  std::string name;  // of its session
  std::unique_ptr<UntypedDriver> driver;
  BackendOptions backend;
  SessionOptions session;
  // The state before the simulation diverged, if that is what `fault` says; otherwise empty. To be
  // called while nobody uses the driver.
  std::function<SimulationState(const Fault& fault)> state_before{
      [](const Fault&) { return SimulationState(); }};
};

// Makes the robot that is called `robot` on the command line: "fake", a configuration or the path
// of one, or a log to be played. `overrides` are settings such as "fingers.height=0.3"; a
// simulation begins in the state that was saved in the file `state`. Throws ConfigError,
// InvalidArgument, SystemError.
[[nodiscard]] RunnableRobot make_robot(const std::string& robot,
                                       const std::vector<std::string>& overrides,
                                       const std::optional<std::filesystem::path>& state);

}  // namespace trifinger::apps
