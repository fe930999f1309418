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
  kJoints,  // then each joint moves slowly by 2 degrees and back
};

// What a test of a running robot has found.
struct RobotTestReport {
  SelfTest kind{SelfTest::kOff};
  std::string problem;  // a sentence; empty: it passes
  TimeIndex steps{0};
  std::vector<boards::JointReport> joints;    // only after kJoints
  std::optional<std::array<double, 3>> cube;  // where it lies [m], if there is one
};

// Returns the torques that carry the joints at a position [Nm].
using WeightOf = std::function<std::vector<double>(const std::vector<double>& position)>;

// Tests a robot that runs in another process, as any program could: in the session of `robot`,
// which ends. Its joints must follow, and their load must be their weight if `weights` is given.
// Robots whose actions have no positions are only held.
//
// `look` is called again and again and may throw. A fault is a problem and not thrown.
[[nodiscard]] RobotTestReport test_robot(UntypedFrontend& robot, SelfTest kind,
                                         const std::function<void()>& look,
                                         const WeightOf& weights);

}  // namespace trifinger::apps
