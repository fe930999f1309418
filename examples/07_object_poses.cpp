// SPDX-License-Identifier: BSD-3-Clause
// Object poses have their own rate and delay. `get_latest_at(t)` returns the pose that was known at
// step t. A program that uses it computes the same results, whenever its processes happen to run.
#include <cstdlib>
#include <iostream>

#include "trifinger/sim/simulation.hpp"

int main(int argument_count, char** arguments) {
  // The poses are like those of a camera at 100 Hz that needs 25 ms to see the object.
  const trifinger::Simulation simulation({.object_period = 10, .object_delay = 25});
  simulation.robot().place_object("cube", {.position = {0.0, 0.0, 0.1}});  // it will fall
  // A robot of the name that this program is given has a cube on its table.
  const bool is_named = argument_count > 1;
  auto robot =
      is_named ? trifinger::connect<trifinger::TriFinger>(arguments[1]) : simulation.connect();
  const trifinger::Companion<trifinger::CubeObservation> object(robot.companion("object"));

  const auto hold = trifinger::hold_position(robot.latest_observation());
  bool is_late_enough = true;
  auto t = robot.append_desired_action(hold);
  while (t < 400) {
    robot.wait_until_time_index(t);
    const auto pose = object.get_latest_at(t);  // nothing if no pose had arrived
    if (t >= 100 && t % 100 == 0) {
      std::cout << "step " << t << ": at step " << pose->stamp.capture_index << " the cube was "
                << pose->cube.position[2] << " m high\n";
    }
    // The pose from before step 0 is known from the beginning. All others arrive some time after
    // their capture, here 25 steps.
    if (t >= 25 && !is_named) is_late_enough &= pose->stamp.capture_index <= t - 25;
    t = robot.append_desired_action(hold);
  }
  const auto rest = object.get_latest_at(t - 1);
  const bool lies = rest && rest->cube.position[2] > 0.030 && rest->cube.position[2] < 0.034;
  return lies && is_late_enough ? EXIT_SUCCESS : EXIT_FAILURE;
}
