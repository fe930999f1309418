// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "shared_robot/robot_test.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// What is done with the cube before and after a job.
enum class CubeRecovery : unsigned char {
  kLeave,   // It stays where it is.
  kTry,     // It is brought to the middle; if that fails, the report says so.
  kDemand,  // The robot is not fit for use unless the cube lies in the middle.
};

struct PreparationOptions {
  SelfTest self_test{SelfTest::kJoints};
  CubeRecovery cube{CubeRecovery::kTry};
  Nanoseconds timeout{std::chrono::seconds(60)};  // for the robot to be ready for a user
  // Called again and again. What it throws ends the preparation.
  std::function<void()> look{[] {}};
  std::function<void(const std::string& sentence)> report{[](const std::string& /*sentence*/) {}};
};

// How the robot is.
struct PreparationReport {
  bool is_fit{false};
  std::string problem;                  // why it is not fit; empty if it is
  std::vector<std::string> recovered;   // the faults that were cleared
  std::optional<RobotTestReport> test;  // nothing if it did not come so far
  std::string cube;                     // what became of the cube; empty if there is none
};

// Waits until the robot that runs under this name holds its pose for the next user, and clears its
// fault if there is one. Throws nothing but what `look` throws; the report has no test.
[[nodiscard]] PreparationReport wait_until_free(const std::string& robot,
                                                const PreparationOptions& options);

// Makes the robot fit for the next user: waits until it is free, clears its fault, tests it, and
// brings the cube to the middle.
[[nodiscard]] PreparationReport make_fit(const std::string& robot,
                                         const PreparationOptions& options);

}  // namespace trifinger::apps
