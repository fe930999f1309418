// SPDX-License-Identifier: BSD-3-Clause
// The paper's basic control loop: moves the joints to a goal, and holds them there until somebody
// stops the robot. Start a robot first: `trifinger run sim`. In the end, stop it:
// `trifinger stop sim`.
#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"

namespace {

constexpr trifinger::JointVector<9> kGoal{0.1, 0.8, -1.5, 0.1, 0.8, -1.5, 0.1, 0.8, -1.5};  // [rad]

// Computes a[t+1] from y[t]: a target on the way to the goal. The robot's own PD controller follows
// it.
trifinger::TriFinger::Action policy(const trifinger::TriFinger::Observation& y) {
  auto target = y.position;
  for (std::size_t i = 0; i < target.size(); ++i) {
    target[i] += std::clamp(kGoal[i] - y.position[i], -0.1, 0.1);
  }
  return trifinger::TriFinger::Action::of_position(target);
}

}  // namespace

int main() {
  try {
    auto robot = trifinger::connect<trifinger::TriFinger>("sim");
    const auto hold = trifinger::hold_position(robot.latest_observation());

    auto t = robot.append_desired_action(hold);
    for (;;) t = robot.append_desired_action(policy(robot.get_observation(t)));
  } catch (const trifinger::RobotStopped& stopped) {
    std::cout << stopped.what() << '\n';
    return stopped.fault().needs_recovery() ? EXIT_FAILURE : EXIT_SUCCESS;
  } catch (const trifinger::Error& error) {
    std::cerr << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
