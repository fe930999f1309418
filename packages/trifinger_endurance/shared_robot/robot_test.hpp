// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "boards/self_test.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::apps {

enum class SelfTest : unsigned char {
  kOff,     // nothing is tested
  kHold,    // the robot holds its pose for half a second
  kJoints,  // it goes to its initial position, where each joint moves slowly by 2 degrees and back
};

// What a test of a running robot has found.
struct RobotTestReport {
  SelfTest kind{SelfTest::kOff};
  std::string problem;  // a sentence; empty: it passes
  TimeIndex steps{0};
  std::vector<boards::JointReport> joints;    // only after kJoints
  std::optional<std::array<double, 3>> cube;  // where it lies [m], if there is one
};

// What is known of a robot; nothing of it has to be.
struct KnownRobot {
  // Returns the torques that carry the joints at a position [Nm].
  std::function<std::vector<double>(const std::vector<double>& position)> weight{};
  std::vector<double> initial_position{};  // [rad], [m]
};

// Tests a robot that runs in another process, as any program could: in the session of `robot`,
// which ends. Its joints must follow, and their load must be their weight if that is known. Robots
// whose actions have no positions are only held.
//
// It goes to its initial position for that, if that is known: it may have fallen where it is.
// Something may be in the way of joints there, too, so those that fail have a few more attempts,
// each at another position.
//
// `look` is called again and again and may throw. A fault is a problem and not thrown.
[[nodiscard]] RobotTestReport test_robot(UntypedFrontend& robot, SelfTest kind,
                                         const std::function<void()>& look,
                                         const KnownRobot& known);

}  // namespace trifinger::apps
