// SPDX-License-Identifier: BSD-3-Clause
// A policy at 100 Hz on a robot at 1 kHz: every action is appended ten times.
#include <cstdlib>
#include <iostream>

#include "trifinger/sim/simulation.hpp"

namespace {

constexpr trifinger::TimeIndex kFactor = 10;

// Swings joint 0 of each finger about zero. The robot's PD controller follows the targets at 1 kHz,
// so 100 Hz is enough for the policy.
trifinger::TriFinger::Action policy(trifinger::TriFinger::Action action,
                                    const trifinger::TriFinger::Observation& y) {
  for (std::size_t i = 0; i < y.position.size(); i += 3) {
    action.position[i] = y.position[i] < 0.0 ? 0.2 : -0.2;
  }
  return action;
}

}  // namespace

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>();

  // t counts the policy's cycles, and kFactor * t the robot's steps, like in the paper.
  // y[kFactor * t] belongs to the last step that has an action. So in real time the policy has one
  // period to answer, not kFactor periods.
  const auto hold = trifinger::hold_position(robot.latest_observation());
  robot.append_desired_action(hold);
  for (trifinger::TimeIndex t = 0; t < 100; ++t) {
    const auto action = policy(hold, robot.get_observation(kFactor * t));
    for (int i = 0; i < kFactor; ++i) robot.append_desired_action(action);
  }
  robot.finish();

  // A robot in real time repeats an action if this program is late; later ones then shift by a
  // step.
  const auto steps = robot.current_time_index();
  const bool is_shifted = steps > 1001;
  int swings = 0;
  for (trifinger::TimeIndex t = 1; t < 100; ++t) {
    const double target = robot.get_desired_action(kFactor * t + 1).position[0];
    if (target != robot.get_desired_action(kFactor * (t - 1) + 1).position[0]) ++swings;
    // All steps of a cycle have the same action.
    const double last = robot.get_desired_action(kFactor * t + kFactor).position[0];
    if (target != last && !is_shifted) return EXIT_FAILURE;
  }
  std::cout << steps << " steps, 100 actions, " << swings << " changes of direction\n";
  return steps >= 1001 && swings > 4 ? EXIT_SUCCESS : EXIT_FAILURE;
}
