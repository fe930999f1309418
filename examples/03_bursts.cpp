// SPDX-License-Identifier: BSD-3-Clause
// Appends a trajectory that is known in advance in one call, and reads it back in another.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <vector>

#include "trifinger/sim/simulation.hpp"

namespace {

// One second from one pose to another, at rest at both ends.
std::vector<trifinger::TriFinger::Action> plan(const trifinger::JointVector<9>& from,
                                               const trifinger::JointVector<9>& to) {
  std::vector<trifinger::TriFinger::Action> actions;
  for (int step = 1; step <= 1000; ++step) {
    const double s = step / 1000.0;
    const double progress = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    trifinger::JointVector<9> target;
    for (std::size_t i = 0; i < target.size(); ++i) {
      target[i] = from[i] + progress * (to[i] - from[i]);
    }
    actions.push_back(trifinger::TriFinger::Action::of_position(target));
  }
  return actions;
}

}  // namespace

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>();
  const auto start = robot.latest_observation().position;
  auto end = start;
  for (std::size_t i = 0; i < end.size(); i += 3) end[i] += 0.3;

  // The queue takes 4096 actions before an append has to wait. From here on the robot needs no new
  // actions for a second, so this program may spend that time on something else, in real time as
  // well.
  const auto there = plan(start, end);
  const auto back = plan(end, start);
  robot.append_desired_actions(there);
  const auto last = robot.append_desired_actions(back);

  // Waits for the last step, then copies all observations.
  std::vector<trifinger::TriFinger::Observation> observations(static_cast<std::size_t>(last + 1));
  robot.get_observations(0, observations);

  double lag = 0.0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const auto& target = i < there.size() ? there[i] : back[i - there.size()];
    lag = std::max(lag, std::abs(target.position[0] - observations[i].position[0]));
  }
  const double turned = observations[999].position[0] - start[0];
  std::cout << observations.size() << " steps; joint 0 turned by " << turned << " rad and back, "
            << lag << " rad behind at most\n";
  return last == 1999 && std::abs(turned - 0.3) < 0.05 && lag < 0.1 ? EXIT_SUCCESS : EXIT_FAILURE;
}
