// SPDX-License-Identifier: BSD-3-Clause
// Simulates a TriFinger with a cube on its table.
#include <cstdio>

#include "trifinger/core/frontend.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulation.hpp"

int main() {
  auto robot = trifinger::simulate<trifinger::TriFinger>();
  const trifinger::Companion<trifinger::CubeObservation> object(robot.companion("object"));

  const auto hold = trifinger::hold_position(robot.latest_observation());
  trifinger::TimeIndex t = robot.append_desired_action(hold);
  while (t < 100) {
    static_cast<void>(robot.get_observation(t));
    t = robot.append_desired_action(hold);
  }
  const auto seen = object.get_latest_at(t);
  if (!seen) return 1;
  std::printf("at step %d the cube is %.3f m above the table\n", static_cast<int>(t),
              seen->cube.position[2]);
}
