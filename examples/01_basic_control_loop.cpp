// SPDX-License-Identifier: BSD-3-Clause
// The paper's basic control loop: once as fast as the simulation can, once at 1 kHz. The lines are
// the same.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "trifinger/core/backend.hpp"
#include "trifinger/sim/simulation.hpp"

namespace {

constexpr trifinger::JointVector<9> kGoal{0.1, 0.8, -1.5, 0.1, 0.8, -1.5, 0.1, 0.8, -1.5};  // [rad]

// a[t+1] as a function of y[t]: a target between here and the goal, which the robot's own PD
// follows.
trifinger::TriFinger::Action policy(const trifinger::TriFinger::Observation& y) {
  trifinger::JointVector<9> target;
  for (std::size_t i = 0; i < target.size(); ++i) {
    target[i] = y.position[i] + std::clamp(kGoal[i] - y.position[i], -0.1, 0.1);
  }
  return trifinger::TriFinger::Action::of_position(target);
}

bool is_at_goal(const trifinger::TriFinger::Observation& y) {
  double error = 0.0;
  for (std::size_t i = 0; i < kGoal.size(); ++i) {
    error = std::max(error, std::abs(kGoal[i] - y.position[i]));
  }
  std::cout << "  largest distance from the goal: " << error << " rad\n";
  return error < 0.05;
}

// Without deadlines: the back-end waits for every action, however long `policy` takes, and the
// simulated time stands still meanwhile. Here it even runs inside of `get_observation`: no thread,
// nothing to wait for.
bool runs_without_deadlines() {
  auto robot = trifinger::simulate<trifinger::TriFinger>();
  const auto hold = trifinger::hold_position(robot.latest_observation());

  auto t = robot.append_desired_action(hold);
  while (t < 1000) t = robot.append_desired_action(policy(robot.get_observation(t)));
  robot.finish();

  std::cout << "without deadlines: " << t + 1 << " steps\n";
  return is_at_goal(robot.get_observation(t + 1));
}

// In real time: there is a new observation every millisecond, and it is `get_observation` that
// waits. A policy that is late ends the session with a fault, unless the back-end may repeat the
// action before. This machine may be busy with other things, so here it may.
bool runs_in_real_time() {
  trifinger::SimulatedRobot<trifinger::TriFinger> driver;
  auto host = trifinger::SessionHost::anonymous();
  trifinger::Backend backend(driver, host,
                             {.mode = trifinger::BackendOptions::Mode::kRealTime,
                              .max_action_repeats = 5000,
                              .max_skipped_ticks = 5000});
  const trifinger::BackendThread thread(backend);
  trifinger::Frontend<trifinger::TriFinger> robot(host);
  const auto hold = trifinger::hold_position(robot.latest_observation());

  auto t = robot.append_desired_action(hold);
  while (t < 600) t = robot.append_desired_action(policy(robot.get_observation(t)));
  robot.finish();

  const trifinger::Status status = robot.get_status(t + 1);  // the last one says how it ended
  std::cout << "in real time: " << t + 1 << " steps in " << status.tick << " ms\n";
  return is_at_goal(robot.get_observation(t + 1)) && status.tick >= t;
}

}  // namespace

int main() { return runs_without_deadlines() && runs_in_real_time() ? EXIT_SUCCESS : EXIT_FAILURE; }
