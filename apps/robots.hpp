// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {

// All that a back-end is made of.
struct RunnableRobot {
  std::string name;  // of its session
  std::unique_ptr<UntypedDriver> driver;
  BackendOptions backend;
  SessionOptions session;
};

// Makes the robot that is called `robot` on the command line: "fake", a configuration or the path
// of one. `overrides` are settings such as "fingers.height=0.3". Throws ConfigError,
// InvalidArgument, SystemError.
[[nodiscard]] RunnableRobot make_robot(const std::string& robot,
                                       const std::vector<std::string>& overrides);

}  // namespace trifinger::apps
