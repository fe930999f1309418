// SPDX-License-Identifier: BSD-3-Clause
// A simulation continues from a saved state exactly like the first time. It can begin anew in any
// state that you choose.
#include <cstdlib>
#include <iostream>
#include <vector>

#include "trifinger/sim/simulation.hpp"

namespace {

using Observations = std::vector<trifinger::TriFinger::Observation>;

// Pushes all fingers inwards, against the cube and each other, where small differences would grow.
Observations push(trifinger::Frontend<trifinger::TriFinger>& robot) {
  trifinger::TriFinger::Action action;
  action.torque.fill(-0.05);
  const std::vector<trifinger::TriFinger::Action> actions(500, action);
  const auto last = robot.append_desired_actions(actions);
  Observations observations(actions.size());
  robot.get_observations(last - 499, observations);
  return observations;
}

bool is_same(const Observations& a, const Observations& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].position != b[i].position || a[i].tip_force != b[i].tip_force) return false;
  }
  return true;
}

}  // namespace

int main() {
  const trifinger::Simulation simulation;
  trifinger::SimulationState saved;
  Observations first;
  {
    auto robot = simulation.connect();
    push(robot);
    saved = simulation.robot().save();
    first = push(robot);
  }

  // Every session begins in the state that was restored before it.
  simulation.robot().restore(saved);
  auto robot = simulation.connect();
  const Observations second = push(robot);
  robot.finish();
  const bool is_repeated = is_same(first, second);
  std::cout << "the same 500 steps from the saved state: " << (is_repeated ? "equal" : "different")
            << ", to the last bit\n";

  const trifinger::JointVector<9> pose{0.1, 0.9, -1.7, 0.1, 0.9, -1.7, 0.1, 0.9, -1.7};
  simulation.robot().reset(pose, {.seed = 7});
  const auto y = simulation.connect().latest_observation();
  std::cout << "after the reset joint 0 is at " << y.position[0] << " rad\n";
  return is_repeated && y.position == pose ? EXIT_SUCCESS : EXIT_FAILURE;
}
