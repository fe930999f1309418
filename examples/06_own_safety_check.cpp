// SPDX-License-Identifier: BSD-3-Clause
// A safety check for one task is a plain function. After it, the robot's own limits still hold.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "trifinger/joint/reasons.hpp"
#include "trifinger/sim/simulation.hpp"

namespace {

constexpr double kMaxSpeed = 1.0;  // limit of this task [rad/s]

// Brakes joints that are too fast. It gets the newest observation and an action that is finite,
// with all gains filled in, and may change the action. It runs in the loop, so it must not wait and
// must not allocate.
void slow_down(const trifinger::TriFinger::Observation& y, trifinger::TriFinger::Action& action) {
  for (std::size_t i = 0; i < y.velocity.size(); ++i) {
    if (std::abs(y.velocity[i]) <= kMaxSpeed) continue;
    action.torque[i] = -0.1 * y.velocity[i];
    action.position[i] = trifinger::kNotGiven;
  }
}

struct Result {
  double max_speed{0.0};
  int checked_steps{0};
};

// Swings joint 0 of the first finger to the side, as fast as allowed.
Result swing(const trifinger::Simulation& simulation) {
  auto robot = simulation.connect();
  auto action = trifinger::hold_position(robot.latest_observation());
  action.position[0] += 0.3;
  Result result;
  auto t = robot.append_desired_action(action);
  while (t < 300) {
    const auto y = robot.get_observation(t);
    result.max_speed = std::max(result.max_speed, std::abs(y.velocity[0]));
    t = robot.append_desired_action(action);
    // The applied action says, as a reason, what the check did to it.
    const auto applied = robot.get_applied_action(t - 1);
    if (has(applied.reasons[0], trifinger::Reason::kOwnCheck)) ++result.checked_steps;
  }
  return result;
}

}  // namespace

int main() {
  const trifinger::Simulation simulation;
  const Result without = swing(simulation);

  simulation.robot().add_check<trifinger::TriFinger>(slow_down);  // only between sessions
  const Result with = swing(simulation);

  std::cout << "fastest without the check: " << without.max_speed << " rad/s\n"
            << "fastest with it:           " << with.max_speed << " rad/s; it acted in "
            << with.checked_steps << " steps\n";
  return without.max_speed > 1.5 * kMaxSpeed && without.checked_steps == 0 &&
                 with.max_speed < 1.2 * kMaxSpeed && with.checked_steps > 0
             ? EXIT_SUCCESS
             : EXIT_FAILURE;
}
